// What is kept for as long as the browser's window, over other views and a reload.

/** Empty where nothing was kept: a browser that keeps nothing may refuse to be asked. */
export function kept(key: string): string {
  try {
    return sessionStorage.getItem(key) ?? "";
  } catch {
    return "";
  }
}

export function keep(key: string, text: string): void {
  try {
    sessionStorage.setItem(key, text);
  } catch {
    // Then it is known until the page is loaded again, if at all.
  }
}
