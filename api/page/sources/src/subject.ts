// Who lies on the bench: read with the mark that a change has to name, so that two pages do not overwrite each other.
import { ask, every, marked, requestKey } from "./api";
import { held, inControl } from "./lease";
import { useLoaded } from "./loaded";

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

/** At this site: the lower of the subject's and the site's own. */
export const thresholdAt = ({ site, pain_threshold_N, site_thresholds_N }: Subject) => Math.min(pain_threshold_N, site_thresholds_N[site] ?? pain_threshold_N);

/** Thresholds of sites go along only where they are changed: another subject has others, which the service knows. */
const usual = ({ id, site, pain_threshold_N }: Subject) => ({ id, site, pain_threshold_N });

export const keepSubject = (before: OnBench, changed: Partial<Subject>) =>
  inControl(() => ask("put", PATH, { body: { ...usual(before.value), ...changed }, headers: { ...held(), ...requestKey(), "If-Match": before.mark } }));

/** Codes and sites that were used before, to choose from. */
export const useKnownSubjects = () => useLoaded(() => every("/api/v1/subjects"));
