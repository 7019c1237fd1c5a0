// Every trial, how good it is and why.
import type { Schema } from "../../api";
import type { Loaded } from "../../loaded";
import { Card, Rows, Show, shown } from "../../parts/basics";
import { Quality } from "../../parts/quality";
import { t } from "../../texts";

export function TrialsCard({ of, trials, unlisted }: { of: string; trials: Loaded<Schema["TrialEntry"][]>; unlisted: number }) {
  const sorted = (all: Schema["TrialEntry"][]) => [...all].sort((one, other) => one.name.localeCompare(other.name));
  return (
    <Card id="trials-card" title={t.session.quality} wide>
      <Show loaded={trials} empty={!unlisted && <p>{t.session.noTrials}</p>}>
        {(all) => all.length > 0 && (
          <Rows label={t.session.trialsOf(of)} heads={[t.result.trial, t.result.speed, t.result.peak, t.result.quality]} id="trials">
            {sorted(all).map((trial) => (
              <tr key={trial.key}>
                <th scope="row">{trial.name}</th>
                <td>{trial.speed_mm_s == null ? t.unknown : `${shown(trial.speed_mm_s, 0)} mm/s`}</td>
                <td>{trial.peak_force_N == null ? t.unknown : `${shown(trial.peak_force_N)} N`}</td>
                <td><Quality of={trial.quality} />{trial.reasons.map((reason) => <p key={reason} class="quiet">{reason}</p>)}</td>
              </tr>
            ))}
          </Rows>
        )}
      </Show>
      {unlisted > 0 && <p id="unlisted" class="notice warn">{t.session.unlisted(unlisted)}</p>}
    </Card>
  );
}
