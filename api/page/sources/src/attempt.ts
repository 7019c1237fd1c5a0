// What was asked for last, and what came of it; shown at one place in every view and read out.
import { signal } from "@preact/signals";

export const message = signal("");
export const failed = signal(false);

export async function attempt(action: () => Promise<unknown>): Promise<boolean> {
  try {
    const said = await action();
    message.value = typeof said === "string" ? said : "";
    failed.value = false;
    return true;
  } catch (error) {
    message.value = (error as Error).message;
    failed.value = true;
    return false;
  }
}
