import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { useApp } from "../app_state";
import { duration } from "../ui/format";

/** Nobody may take old numbers for new ones. */
export function ConnectionBanner() {
  const app = useApp();
  const connection = app.feed.value.connection.value;
  const tick = useSignal(0);
  useEffect(() => {
    if (connection.state !== "lost") return;
    const timer = setInterval(() => tick.value++, 500);
    return () => clearInterval(timer);
  }, [connection.state]);
  if (connection.state === "signIn")
    return (
      <div class="banner" role="alert">
        {connection.reason} Sign in to see the arm.
      </div>
    );
  if (connection.state !== "lost") return null;
  tick.value;
  const sinceS = (performance.now() - connection.sinceMs) / 1e3;
  return (
    <div class="banner lost" role="alert">
      <strong>Connection lost.</strong> What you see is old. {connection.reason} Trying again …{" "}
      <span aria-hidden="true">({duration(Math.max(0, sinceS))})</span>
    </div>
  );
}
