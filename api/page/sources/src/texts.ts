// The language of the page; another one is another file beside `en.ts`.
export { en as t } from "./texts/en";
