// When this page was opened: part of the name under which it takes control.
export const opened = new Date().toLocaleTimeString();

const two = (n: number) => String(n).padStart(2, "0");

/** A name for a session that sorts by time and is valid everywhere. */
export function sessionName(now = new Date(), prefix = ""): string {
  const day = `${now.getFullYear()}${two(now.getMonth() + 1)}${two(now.getDate())}`;
  return `${prefix}${day}-${two(now.getHours())}${two(now.getMinutes())}${two(now.getSeconds())}`;
}

export function date(iso: string): string {
  const time = new Date(iso);
  return Number.isNaN(time.getTime()) ? iso : time.toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

/** The time of day, of what was today. */
export function clockTime(iso: string): string {
  const time = new Date(iso);
  return Number.isNaN(time.getTime()) ? iso : time.toLocaleTimeString(undefined, { timeStyle: "short" });
}

export function duration(seconds: number): string {
  const whole = Math.max(0, Math.round(seconds));
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
}

/** The time of day to the second, of milliseconds since 1970. */
export const timeOf = (ms: number) => new Date(ms).toLocaleTimeString();
