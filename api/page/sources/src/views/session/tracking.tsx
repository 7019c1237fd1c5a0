// The newest run of force tracking in the session, and the way to another.
import { ifThere } from "../../api";
import { useLoaded } from "../../loaded";
import { Card, Show } from "../../parts/basics";
import { TrackedResult, type Tracked } from "../../parts/tracked";
import { link } from "../../route";
import { t } from "../../texts";

export function TrackingCard({ of }: { of: string }) {
  const loaded = useLoaded(() => ifThere<Tracked>("/api/v1/recordings/{session}/{file}", { path: { session: of, file: "track.json" } }).then((value) => [value]), [of]);
  return (
    <Card id="tracking-card" title={t.views.track}>
      <Show loaded={loaded}>
        {([found]) => (
          <>
            {found ? <TrackedResult found={found} /> : <p>{t.session.notTracked}</p>}
            <a id="to-track" class="button" href={link("track", of)}>{t.session.track}</a>
          </>
        )}
      </Show>
    </Card>
  );
}
