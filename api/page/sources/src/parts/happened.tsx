// What happened since this page was opened, newest first; what came while the service was away is there once it is back.
import { timeOf } from "../clock";
import { events, started_ms } from "../live";
import { t } from "../texts";
import { Card, Dot } from "./basics";

// Levels of events: a stop of either kind is 30 or more, what a person should see 20.
const [STOP, WARNING] = [30, 20];
const kind = (level: number) => (level >= STOP ? "bad" : level >= WARNING ? "warn" : "none");

export function Happened() {
  return (
    <Card title={t.bench.happened} id="happened-card" wide>
      {!events.value.length && <p class="quiet">{t.bench.nothingHappened}</p>}
      <div class="scroll tall" tabIndex={0} role="region" aria-label={t.bench.events}>
        <ul class="plain" id="happened">
          {events.value.map((one, i) => (
            <li key={events.value.length - i}>
              <Dot kind={kind(one.level)} />
              {started_ms.value > 0 && <span class="quiet">{timeOf(started_ms.value + one.time_ns * 1e-6)}</span>}
              <span>{one.text}</span>
            </li>
          ))}
        </ul>
      </div>
    </Card>
  );
}
