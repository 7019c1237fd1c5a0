// How good a trial is, in a word with a sign that is no colour alone, and why.
import { t } from "../texts";
import { Dot } from "./basics";

const KINDS = { good: "good", usable: "warn", bad: "bad" } as const;

export function Quality({ of }: { of: string }) {
  return <span class="quality"><Dot kind={KINDS[of as keyof typeof KINDS] ?? "none"} />{t.quality[of || "none"] ?? of}</span>;
}

/** The worst of several; empty where nobody judged. */
export function worst(all: string[]): string {
  return ["bad", "usable", "good"].find((one) => all.includes(one)) ?? "";
}
