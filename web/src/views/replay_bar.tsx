import { useRef } from "preact/hooks";
import { selectedLink, useApp } from "../app_state";
import { ReplayFeed } from "../model/replay_feed";
import { clockTime, dateTime, duration, secondsOf } from "../ui/format";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 100];

/** Steers a log that is played; its time line shows where contacts were. */
export function ReplayBar() {
  const app = useApp();
  const feed = app.feed.value;
  if (!(feed instanceof ReplayFeed)) return null;
  const status = feed.status.value;
  const fromS = status ? secondsOf(status.fromUtcNs) : NaN;
  const toS = status ? secondsOf(status.toUtcNs) : NaN;
  const playing = status && !status.paused && !status.ended;
  const toggle = () => (status?.ended ? feed.seek(fromS) : feed.pause(Boolean(playing)));
  return (
    <section class="replay" aria-label="Replay">
      <div class="row">
        <strong class="replay-word">REPLAY</strong>
        <span class="log-name">{feed.log}</span>
        <button type="button" class="primary" onClick={() => void toggle()} disabled={!status}>
          {status?.ended ? "Again" : playing ? "Pause" : "Play"}
        </button>
        <button
          type="button"
          onClick={() => void feed.step(1)}
          disabled={!status || status.ended}
          title="One frame on"
        >
          Step
        </button>
        <label>
          Speed{" "}
          <select
            value={status?.speed ?? 1}
            onChange={(event) => void feed.setSpeed(Number(event.currentTarget.value))}
          >
            {SPEEDS.map((speed) => (
              <option value={speed}>{speed} ×</option>
            ))}
          </select>
        </label>
        <label>
          <input
            type="checkbox"
            defaultChecked={feed.loop}
            onChange={(event) => void feed.setLoop(event.currentTarget.checked)}
          />{" "}
          Loop
        </label>
        <span class="numbers">
          {dateTime(feed.positionS.value)} · {duration(Math.max(0, feed.positionS.value - fromS))} of{" "}
          {duration(toS - fromS)}
        </span>
        <span class="grow" />
        <button type="button" onClick={() => app.play("")}>
          Back to the live arm
        </button>
      </div>
      {feed.trouble.value && (
        <p role="alert" class="refusal">
          {feed.trouble.value}
        </p>
      )}
      {status && <TimeLine feed={feed} fromS={fromS} toS={toS} />}
    </section>
  );
}

function TimeLine({ feed, fromS, toS }: { feed: ReplayFeed; fromS: number; toS: number }) {
  const app = useApp();
  const track = useRef<HTMLDivElement>(null);
  const link = selectedLink(app);
  const length = Math.max(1e-3, toS - fromS);
  const share = (timeS: number) =>
    `${(100 * Math.min(1, Math.max(0, (timeS - fromS) / length))).toFixed(3)}%`;
  const spans = feed.contacts.value;
  const positionS = Number.isFinite(feed.positionS.value) ? feed.positionS.value : fromS;
  const seekTo = (clientX: number) => {
    const box = track.current!.getBoundingClientRect();
    void feed.seek(fromS + Math.min(1, Math.max(0, (clientX - box.left) / box.width)) * length);
  };
  const steer = (event: KeyboardEvent) => {
    const steps: Record<string, number> = {
      ArrowLeft: -1,
      ArrowRight: 1,
      PageDown: -10,
      PageUp: 10,
      Home: -Infinity,
      End: Infinity,
    };
    const step = steps[event.key];
    if (step === undefined) return;
    event.preventDefault();
    // From where the last key led, which need not be drawn yet.
    const nowS = feed.positionS.peek();
    void feed.seek(Math.min(toS, Math.max(fromS, (Number.isFinite(nowS) ? nowS : fromS) + step)));
  };
  return (
    <div
      ref={track}
      class="track"
      role="slider"
      tabIndex={0}
      aria-label={`Place in the log; ${spans.length} contacts are marked`}
      aria-valuemin={0}
      aria-valuemax={Math.round(length)}
      aria-valuenow={Math.round(positionS - fromS)}
      aria-valuetext={clockTime(positionS)}
      onPointerDown={(event) => seekTo(event.clientX)}
      onKeyDown={steer}
    >
      {spans.map((span) => (
        <span
          class={span.link === link ? "span own" : "span"}
          style={{ left: share(span.fromS), width: `max(2px, ${(100 * (span.toS - span.fromS)) / length}%)` }}
          title={`${span.link} #${span.id}: ${span.peakN.toFixed(2)} N at ${clockTime(span.fromS)}`}
        />
      ))}
      <span class="cursor" style={{ left: share(positionS) }} />
      {feed.looking.value && <span class="small looking">looking for contacts …</span>}
    </div>
  );
}
