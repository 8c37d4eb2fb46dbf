import type { ReadonlySignal } from "@preact/signals";

/** How the way to the server does. */
export type Connection =
  | { state: "connecting" }
  | { state: "live" }
  | { state: "lost"; reason: string; sinceMs: number; retryAtMs: number }
  | { state: "signIn"; reason: string };

/** What fills the store: the arm as it is now, or a log. */
export interface Feed {
  readonly connection: ReadonlySignal<Connection>;
  start(): void;
  stop(): void;
  /** Nobody looks: as little as possible is fetched. */
  setHidden(hidden: boolean): void;
}
