// How well force followed what was asked, level by level.
import type { Schema } from "../api";
import { t } from "../texts";
import { Rows, shown, significant } from "./basics";

export type Tracked = Schema["TrackResult"];

export function TrackedResult({ found }: { found: Tracked }) {
  const { rms_error_N: held_N, max_error_percent: held_percent, followed } = found;
  const held = found.levels.length > 0 && held_N !== null && held_percent !== null;
  return (
    <div class="tracked">
      <dl class="facts large">
        <div>
          <dt>{held ? t.track.heldRms : t.track.rms}</dt>
          <dd><span id="rms">{shown(held ? held_N : followed.rms_error_N, 3)}</span> <small>N</small></dd>
        </div>
        <div>
          <dt>{held ? t.track.heldLargest : t.track.largest}</dt>
          <dd>{held ? shown(held_percent, 2) : shown(followed.largest_error_N, 2)} <small>{held ? "%" : "N"}</small></dd>
        </div>
        <div><dt>{t.track.missed}</dt><dd>{found.loop.missed} <small>{t.track.ofCycles(found.loop.cycles)}</small></dd></div>
      </dl>
      {found.levels.length > 0 && (
        <Rows label={t.track.levels} heads={[t.track.given, t.track.actual, t.track.error, t.track.settling]}>
          {found.levels.map((level, i) => (
            <tr key={i}>
              <th scope="row">{significant(level.given_N)} N</th>
              <td>{shown(level.actual_N, 3)} N</td>
              <td>{shown(level.error_percent, 1)} %</td>
              <td>{level.settling_s === null ? t.track.notSettled : `${shown(level.settling_s)} s`}</td>
            </tr>
          ))}
        </Rows>
      )}
      {held && <p>{t.track.whole(shown(followed.rms_error_N, 3), shown(followed.largest_error_N, 2))}</p>}
      {found.reasons?.map((reason) => <p key={reason} class="notice warn">{reason}</p>)}
    </div>
  );
}
