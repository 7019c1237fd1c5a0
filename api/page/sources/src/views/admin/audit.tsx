// Who did what, newest first, and whether anybody changed that list.
import { useState } from "preact/hooks";
import { type Schema, upTo } from "../../api";
import { date } from "../../clock";
import { useLoaded } from "../../loaded";
import { Card, Rows, Show } from "../../parts/basics";
import { t } from "../../texts";

type Line = Schema["AuditLine"];

const AT_ONCE = 200;

const fits = (line: Line, asked: string) => [line.who, line.what, line.outcome].some((text) => text.toLowerCase().includes(asked));

function Lines({ lines }: { lines: readonly Line[] }) {
  return (
    <Rows tall label={t.table(t.admin.audit)} heads={[t.admin.when, t.admin.who, t.admin.what, t.admin.outcome]} body="audit">
      {lines.map((line) => (
        <tr key={line.seq}>
          <td>{date(line.time)}</td>
          <td>{line.who || t.admin.stranger}<br /><span class="quiet">{line.credential}</span></td>
          <td><code>{line.what}</code></td>
          <td class={/^[23]/.test(line.outcome) ? "" : "no"}>{line.outcome}</td>
        </tr>
      ))}
    </Rows>
  );
}

export function Audit() {
  const [many, more] = useState(AT_ONCE);
  const audit = useLoaded(() => upTo("/api/v1/audit", many), [many]);
  const [asked, ask] = useState("");
  const again = <button type="button" class="small" onClick={audit.reload}>{t.admin.refresh}</button>;
  return (
    <Card title={t.admin.audit} aside={again}>
      <p>{t.admin.auditText}</p>
      <Show loaded={audit}>
        {({ items, next, broken }) => {
          const shown = items.filter((line) => fits(line, asked.trim().toLowerCase()));
          return (
            <>
              <p id="audit-whole" class={broken.length ? "notice bad" : "quiet"} role={broken.length ? "alert" : undefined}>{broken.length ? t.admin.broken(broken) : t.admin.whole}</p>
              <form role="search" onSubmit={(event) => event.preventDefault()}>
                <label>{t.admin.search}<input id="audit-search" type="search" value={asked} onInput={(event) => ask(event.currentTarget.value)} /></label>
              </form>
              {shown.length ? <Lines lines={shown} /> : <div class="empty"><p>{t.admin.noLine}</p></div>}
              {next && <button type="button" onClick={() => more((n) => n + AT_ONCE)}>{t.sessions.more}</button>}
            </>
          );
        }}
      </Show>
    </Card>
  );
}
