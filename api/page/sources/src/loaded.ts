// What a view shows that has to be fetched first: loading, failed with a sentence, or there.
import { useEffect, useRef, useState } from "preact/hooks";
import { unanswered } from "./api";
import { contact } from "./live";

export interface Loaded<T> {
  value: T | null;
  error: string;
  loading: boolean;
  reload: () => void;
}

// Whoever waits for a view sees this as soon; an answer that was lost while the service is there is asked for again.
const AGAIN_MS = 1000;

/** Fetches again whenever ``on`` changes, or every ``every_ms``. What came before stays until something newer is there. */
export function useLoaded<T>(load: () => Promise<T>, on: unknown[] = [], every_ms = 0): Loaded<T> {
  const [turn, setTurn] = useState(0);
  const [state, setState] = useState<{ value: T | null; error: string; loading: boolean }>({ value: null, error: "", loading: true });
  useEffect(() => {
    let [current, later] = [true, 0];
    load().then(
      (value) => current && setState({ value, error: "", loading: false }),
      (error: Error) => {
        if (!current) return;
        setState((before) => ({ ...before, error: error.message, loading: false }));
        if (unanswered(error)) later = window.setTimeout(() => setTurn((n) => n + 1), AGAIN_MS);
      },
    );
    return () => {
      current = false;
      clearTimeout(later);
    };
  }, [turn, ...on]);
  const failed = useRef(false);
  failed.current = Boolean(state.error);
  // What failed while the service was away is asked for again once it is back.
  useEffect(() => contact.subscribe((now) => void (now === "live" && failed.current && setTurn((n) => n + 1))), []);
  useEffect(() => {
    if (!every_ms) return;
    const timer = setInterval(() => setTurn((n) => n + 1), every_ms);
    return () => clearInterval(timer);
  }, [every_ms]);
  return { ...state, reload: () => setTurn((n) => n + 1) };
}
