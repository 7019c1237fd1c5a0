// What every view is made of: cards, numbers, what is loading, missing or failed.
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { contact } from "../live";
import type { Loaded } from "../loaded";
import { t } from "../texts";

export function Card({ title, children, id, wide = false, aside }: { title: string; children: ComponentChildren; id?: string; wide?: boolean; aside?: ComponentChildren }) {
  const heading = `${id ?? title.replace(/\W+/g, "-")}-title`.toLowerCase();
  return (
    <section class={wide ? "card wide" : "card"} id={id} aria-labelledby={heading}>
      <header class="card-head">
        <h2 id={heading}>{title}</h2>
        {aside}
      </header>
      {children}
    </section>
  );
}

/** A number as a person reads it; nothing known is shown as nothing known, not as zero. */
export function shown(value: number | null | undefined, digits = 2): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return t.unknown;
  // No minus before what rounds to zero: the sign would flicker with the noise.
  const rounded = value.toFixed(digits);
  return Number(rounded) === 0 ? (0).toFixed(digits) : rounded.replace("-", "−");
}

/** How large a file is. */
export const sizeOf = (bytes: number) => (bytes < 1e3 ? `${bytes} bytes` : bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(2)} MB`);

/** As many digits as say something. */
export function significant(value: number | null | undefined, digits = 3): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return t.unknown;
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

/** Shows ``loaded``; ``empty`` where there is nothing in it. */
export function Show<T>({ loaded, empty, children }: { loaded: Loaded<T>; empty?: ComponentChildren; children: (value: T) => ComponentChildren }) {
  if (loaded.value === null) {
    if (loaded.loading) return <p class="quiet loading" role="status">{contact.value === "silent" ? t.waiting : t.loading}</p>;
    return (
      <div class="notice bad" role="alert">
        <p>{t.failed} {loaded.error}</p>
        <button type="button" onClick={loaded.reload}>{t.again}</button>
      </div>
    );
  }
  const none = Array.isArray(loaded.value) && !loaded.value.length;
  return (
    <>
      {loaded.error && <p class="notice bad" role="alert">{t.failed} {loaded.error}</p>}
      {none && empty ? <div class="empty">{empty}</div> : children(loaded.value)}
    </>
  );
}

/** Rows under ``heads``; where the screen is narrow a row is a list, each value beside its head. */
export function Rows({ label, heads, children, id, body, tall = false }: { label: string; heads: readonly string[]; children: ComponentChildren; id?: string; body?: string; tall?: boolean }) {
  const table = useRef<HTMLTableElement>(null);
  useLayoutEffect(() => {
    for (const row of table.current!.tBodies[0]!.rows) [...row.cells].forEach((cell, i) => void (cell.dataset.head = heads[i]!.charAt(0).toUpperCase() + heads[i]!.slice(1)));
  });
  return (
    <div class={tall ? "scroll tall" : "scroll"} tabIndex={0} role="region" aria-label={label}>
      <table id={id} ref={table}>
        <thead><tr>{heads.map((head) => (head ? <th key={head} scope="col">{head}</th> : <td key={head} />))}</tr></thead>
        <tbody id={body}>{children}</tbody>
      </table>
    </div>
  );
}

/** A text in which what is to be typed stands between backquotes. */
export function Prose({ text }: { text: string }) {
  return <>{text.split("`").map((part, i) => (i % 2 ? <code key={i}>{part}</code> : part))}</>;
}

export function Dot({ kind }: { kind: "good" | "warn" | "bad" | "none" }) {
  return <i class={`dot ${kind}`} aria-hidden="true" />;
}
