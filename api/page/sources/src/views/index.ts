// Every view by its name in the address; each is one file here, and one section of the texts.
import type { FunctionComponent } from "preact";
import type { View } from "../route";
import { Admin } from "./admin";
import { Bench } from "./bench";
import { Data } from "./data";
import { Devices } from "./devices";
import { Run } from "./run";
import { Session } from "./session";
import { Sessions } from "./sessions";
import { Subjects } from "./subjects";
import { Track } from "./track";

/** A view gets what stands behind its name in the address, such as a session; empty where nothing does. */
export type Viewed = FunctionComponent<{ of: string }>;

export const SHOWN: Record<View, Viewed> = {
  bench: Bench, run: Run, sessions: Sessions, session: Session, track: Track, data: Data, subjects: Subjects, devices: Devices, admin: Admin,
};

export const LISTED: View[] = ["bench", "run", "sessions", "track", "data", "subjects", "devices", "admin"];
/** Under which listed view the navigation shows one that is not listed itself. */
export const UNDER: Partial<Record<View, View>> = { session: "sessions" };
