import { Code, ConnectError } from "@connectrpc/connect";
import { messageOf } from "./session";

export interface KeepOpenOptions {
  /** One life of what is kept open. Calls `alive` with each message. Returns or throws when it has ended. */
  run: (signal: AbortSignal, alive: () => void) => Promise<void>;
  onLost: (reason: string, retryInMs: number, code: Code | undefined) => void;
  /** From the end of this time on without a message a life counts as lost, ms; 0: never. */
  silenceMs: number;
  firstRetryMs?: number;
  longestRetryMs?: number;
}

/** Runs something again and again until it is aborted, with growing pauses as long as it fails. */
export async function keepOpen(stop: AbortSignal, options: KeepOpenOptions): Promise<void> {
  const first = options.firstRetryMs ?? 300;
  let pause = first;
  while (!stop.aborted) {
    const life = new AbortController();
    const end = () => life.abort();
    stop.addEventListener("abort", end, { once: true });
    let watch: ReturnType<typeof setTimeout> | undefined;
    let silent = false;
    const alive = () => {
      pause = first;
      clearTimeout(watch);
      if (options.silenceMs > 0)
        watch = setTimeout(() => {
          silent = true;
          life.abort();
        }, options.silenceMs);
    };
    let reason = "The server ended the stream.";
    let code: Code | undefined;
    try {
      if (options.silenceMs > 0) watch = setTimeout(() => ((silent = true), life.abort()), options.silenceMs);
      await options.run(life.signal, alive);
    } catch (error) {
      code = ConnectError.from(error).code;
      reason = silent ? "Nothing comes from the server." : messageOf(error);
    }
    clearTimeout(watch);
    stop.removeEventListener("abort", end);
    life.abort();
    if (stop.aborted) return;
    options.onLost(reason, pause, code);
    await sleep(pause, stop);
    pause = Math.min(pause * 2, options.longestRetryMs ?? 5000);
  }
}

/** Resolves after that time, or at once when aborted. */
export function sleep(ms: number, stop: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    if (stop.aborted) return resolve();
    const done = () => {
      clearTimeout(timer);
      stop.removeEventListener("abort", done);
      resolve();
    };
    const timer = setTimeout(done, ms);
    stop.addEventListener("abort", done, { once: true });
  });
}
