// All sessions, newest first; each opens as a view of its own.
import { useState } from "preact/hooks";
import { upTo } from "../api";
import { date } from "../clock";
import { rig } from "../live";
import { useLoaded } from "../loaded";
import { Card, Rows, Show } from "../parts/basics";
import { Quality } from "../parts/quality";
import { link } from "../route";
import { t } from "../texts";

const AT_ONCE = 50;
const HEADS = [t.sessions.session, t.sessions.subject, t.sessions.recorded, t.result.recordings, t.result.dropped, t.result.quality];

export function Sessions() {
  const [many, more] = useState(AT_ONCE);
  const sessions = useLoaded(async () => {
    const found = await upTo("/api/v1/sessions", many);
    return Object.assign([...found.items], { next: found.next, remarks: found.remarks ?? [] });
  }, [rig.value?.job?.id, many]);
  return (
    <>
      <h1>{t.sessions.title}</h1>
      <Card title={t.sessions.all}>
        <Show loaded={sessions} empty={<p>{t.sessions.none}</p>}>
          {(all) => (
            <>
              <Rows label={t.sessions.title} heads={HEADS} id="recordings">
                {all.map((one) => (
                  <tr key={one.key}>
                    <th scope="row"><a href={link("session", one.session)}>{one.session}</a></th>
                    <td>{one.subject}{one.site && `, ${one.site}`}</td>
                    <td>{one.at ? date(one.at) : t.unknown}</td>
                    <td>{one.trials}</td>
                    <td>{one.dropped}</td>
                    <td><Quality of={one.quality} /></td>
                  </tr>
                ))}
              </Rows>
              {all.remarks.map((remark) => <p key={remark} class="notice warn">{remark}</p>)}
              {all.next && <button type="button" onClick={() => more((n) => n + AT_ONCE)}>{t.sessions.more}</button>}
            </>
          )}
        </Show>
      </Card>
    </>
  );
}
