// What is known of a person's pain threshold from sessions of their own.
import { get, ifThere } from "../../api";
import { atMost, thresholdAt, type OnBench, type Subject } from "../../subject";

/** A threshold that held for somebody; ``session`` is empty for whoever is on the bench. */
export interface Earlier {
  force_N: number;
  site: string;
  session: string;
  at: string;
}

/** That of the newest session of ``id``, at ``site`` where there is one; null where none tells. */
async function inSessions(id: string, site: string): Promise<Earlier | null> {
  const { items } = await get("/api/v1/sessions", { query: { subject: id, limit: 50 } });
  const made = items.filter((one) => one.subject === id && one.kind !== "import");
  const one = made.find((each) => each.site === site) ?? made[0];
  if (!one) return null;
  const kept = await ifThere<{ subject?: Partial<Subject> }>("/api/v1/recordings/{session}/session.json", { path: { session: one.session } });
  const { pain_threshold_N, site_thresholds_N = {} } = kept?.subject ?? {};
  if (!pain_threshold_N) return null;
  const force_N = atMost(thresholdAt({ id, site: one.site, pain_threshold_N, site_thresholds_N }));
  return { force_N, session: one.session, site: one.site, at: one.at };
}

/** That of whoever is on the bench, if it is ``id``; else what their own sessions tell, and never another's. */
export async function earlier(on: OnBench, id: string, site: string): Promise<Earlier | null> {
  const { value } = on;
  return id === value.id ? { force_N: atMost(thresholdAt(value)), session: "", site: value.site, at: "" } : inSessions(id, site);
}
