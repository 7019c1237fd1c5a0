// What came in: of each recording its streams, how good it is, and which later step takes it.
import type { Schema } from "../../api";
import { Card, Dot, Rows, shown, significant } from "../../parts/basics";
import { link } from "../../route";
import { t } from "../../texts";

type Recording = Schema["RecordingIn"];
type Stream = Schema["StreamIn"];

const KINDS = { good: "good", usable: "warn", bad: "bad" } as const;

function Streams({ of, streams }: { of: string; streams: readonly Stream[] }) {
  return (
    <Rows label={t.table(of)} heads={t.data.streamColumns}>
      {streams.map((one) => (
        <tr key={one.stream}>
          <th scope="row">{t.data.quantities[one.stream] ?? one.stream}</th>
          <td>{one.samples}{one.missing + one.left_out > 0 && <p class="quiet">{t.data.without(one.missing + one.left_out)}</p>}</td>
          <td>{shown(one.span_s, 1)} s</td>
          <td>{significant(one.rate_Hz)} Hz{one.gaps > 0 && <p class="quiet">{t.data.gaps(one.gaps)}</p>}</td>
          <td>{t.data.range(significant(one.lowest), significant(one.highest), one.unit)}</td>
          <td>{significant(one.noise, 2)} {one.unit}</td>
        </tr>
      ))}
    </Rows>
  );
}

function Used({ name, use }: { name: string; use: Schema["Use"] }) {
  return <li><Dot kind={use.used ? "good" : "warn"} /><span>{use.used ? t.data.takes(name) : t.data.leaves(name)}{use.why && `: ${use.why}`}</span></li>;
}

function One({ recording }: { recording: Recording }) {
  const cycles = recording.cycles.filter((one) => !one.refused).length;
  return (
    <details open={recording.quality === "bad"}>
      <summary><Dot kind={KINDS[recording.quality]} /> <strong>{recording.name}</strong> {t.quality[recording.quality]}, {t.data.cycles(cycles)}</summary>
      {recording.reasons.length > 0 && <ul>{recording.reasons.map((one) => <li key={one}>{one}</li>)}</ul>}
      <Streams of={recording.name} streams={recording.streams} />
      <ul class="plain"><Used name={t.kinds.fit!} use={recording.fit} /><Used name={t.kinds.diagnose!} use={recording.diagnose} /></ul>
    </details>
  );
}

export function CameIn({ session, found }: { session: string; found: Schema["ImportResult"] }) {
  const recordings = found.came_in?.recordings ?? [];
  const remarks = [...found.remarks, ...(found.came_in?.remarks ?? [])];
  return (
    <Card title={t.data.result} id="came-in">
      <p role="status">{t.data.done(found.recordings)}</p>
      {remarks.length > 0 && <div class="notice warn"><ul>{remarks.map((one) => <li key={one}>{one}</li>)}</ul></div>}
      <p><a id="open-session" class="button primary" href={link("session", session)}>{t.data.open}</a></p>
      {recordings.map((one) => <One key={one.name} recording={one} />)}
    </Card>
  );
}
