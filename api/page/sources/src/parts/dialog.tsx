// A question over the page. It is not modal: what is modal would take STOP above it out of reach.
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";

export function Dialog({ id, title, open, close, children }: { id: string; title: string; open: boolean; close: () => void; children: ComponentChildren }) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const { current } = dialog;
    if (open && !current!.open) current!.show();
    if (!open && current!.open) current!.close();
  }, [open]);
  return (
    <dialog id={id} ref={dialog} aria-labelledby={`${id}-title`} onKeyDown={(event) => event.key === "Escape" && close()}>
      <h2 id={`${id}-title`}>{title}</h2>
      {children}
    </dialog>
  );
}
