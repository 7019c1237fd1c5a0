// Who lies on the bench: read with the mark that a change has to name, so that two pages do not overwrite each other.
import { ask, every, marked, requestKey } from "./api";
import { keep, kept } from "./kept";
import { held, inControl } from "./lease";
import { useLoaded } from "./loaded";
import { shown } from "./parts/basics";
import { t } from "./texts";

export interface Subject {
  id: string;
  site: string;
  pain_threshold_N: number;
  site_thresholds_N: Record<string, number>;
}

export interface OnBench {
  value: Subject;
  mark: string;
}

const PATH = "/api/v1/subject";

export const useSubject = (on: unknown[] = []) => useLoaded(() => marked<Subject>(PATH), on);

/** The site's own; none holds where nothing was found. */
export const ownOf = ({ site, site_thresholds_N }: Subject) => site_thresholds_N[site] ?? Infinity;

/** At this site: the lower of the subject's and the site's own. */
export const thresholdAt = (subject: Subject) => Math.min(subject.pain_threshold_N, ownOf(subject));

/** Whether the site's own threshold is the lower one. */
export const siteRules = (subject: Subject) => ownOf(subject) < subject.pain_threshold_N;

/** What a field holds to a tenth and never above what was found. */
export const atMost = (force_N: number) => Math.floor(force_N * 10) / 10;

/** Thresholds of sites go along only where they are changed: another subject has others, which the service knows. */
const usual = ({ id, site, pain_threshold_N }: Subject) => ({ id, site, pain_threshold_N });

/** What holds now, what held before, and why the lower of two thresholds is not the one that was set. */
function said(before: Subject, now: Subject): string {
  const [was, is, own] = [thresholdAt(before), thresholdAt(now), now.pain_threshold_N].map((force_N) => shown(force_N, 1)) as [string, string, string];
  const at = shown(ownOf(now), 1);
  const why = siteRules(now) ? t.run.siteHolds(now.site, own) : ownOf(now) < Infinity && at !== own ? t.run.ownHolds(now.site, at) : "";
  return t.run.inForceNow(was, is) + why;
}

const PUT = "put-on-bench";
const inWords = (one: Subject) => t.run.onBench(one.id, one.site, shown(thresholdAt(one), 1));

/** From now on this window takes ``now`` for whom it put on the bench. */
export const remember = (now: Subject) => keep(PUT, inWords(now));

/** Whom this window put on the bench, where that is somebody else by now: a service that begins anew knows nobody. */
export function gone(now: Subject): string {
  const put = kept(PUT);
  return put && put !== inWords(now) ? t.run.gone(put, inWords(now)) : "";
}

/** Changes who is on the bench or what is never passed; what holds then, in words. */
export const keepSubject = (before: OnBench, changed: Partial<Subject>) =>
  inControl(async () => {
    const sent = { body: { ...usual(before.value), ...changed }, headers: { ...held(), ...requestKey(), "If-Match": before.mark } };
    const now = (await ask("put", PATH, sent)) as Subject;
    remember(now);
    return said(before.value, now);
  });

/** Codes and sites that were used before, to choose from. */
export const useKnownSubjects = () => useLoaded(() => every("/api/v1/subjects"));
