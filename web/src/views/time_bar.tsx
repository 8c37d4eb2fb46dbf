import { useEffect, useRef } from "preact/hooks";
import { selectedLink, useApp } from "../app_state";
import { PAST_S } from "../model/past";
import { ReplayFeed, type ContactSpan } from "../model/replay_feed";
import { touchesOf } from "../model/touches";
import { clockTime, dateTime, duration, secondsOf } from "../ui/format";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 100];

/** The time line: of the last minutes of the arm, or of the log that is played. All parts of the page show its moment. */
export function TimeBar() {
  const { feed } = useApp();
  return feed.value instanceof ReplayFeed ? <ReplayBar feed={feed.value} /> : <LiveBar />;
}

function LiveBar() {
  const app = useApp();
  const store = app.store.value;
  store.beat.value;
  const shownS = store.lookedAtS.value;
  const toS = store.timeS;
  useEffect(() => {
    const back = (event: KeyboardEvent) => {
      if (event.key === "Escape" && !document.querySelector("dialog[open]")) app.seek(undefined);
    };
    addEventListener("keydown", back);
    return () => removeEventListener("keydown", back);
  }, []);
  if (!Number.isFinite(toS)) return null;
  const { oldestS } = store;
  const fromS = Number.isFinite(oldestS) ? Math.max(toS - PAST_S, Math.min(oldestS, toS - 1)) : toS - 1;
  const spans = touchesOf(store.events.value).map(({ link, id, beginS, durationS, peakN }) => {
    return { link, id, fromS: beginS, toS: durationS === undefined ? toS : beginS + durationS, peakN };
  });
  return (
    <section class={shownS === undefined ? "replay live" : "replay live back"} aria-label="Time line">
      <span class="now-cell">
        {shownS === undefined ? (
          <strong class="live-word">● LIVE</strong>
        ) : (
          <button type="button" class="primary" onClick={() => app.seek(undefined)} title="Esc">
            Back to now
          </button>
        )}
      </span>
      <TimeLine
        spans={spans.filter((span) => span.toS >= fromS)}
        fromS={fromS}
        toS={toS}
        positionS={shownS ?? toS}
        onSeek={(timeS) => app.seek(timeS < toS ? timeS : undefined)}
      />
      <span class="numbers small ago-cell">
        {shownS === undefined
          ? `last ${duration(toS - fromS)}`
          : `${clockTime(shownS)}, ${duration(Math.max(0, toS - shownS))} ago`}
      </span>
    </section>
  );
}

/** Steers a log that is played; its time line shows where contacts were. */
function ReplayBar({ feed }: { feed: ReplayFeed }) {
  const app = useApp();
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
      {status && (
        <TimeLine
          spans={feed.contacts.value}
          fromS={fromS}
          toS={toS}
          positionS={Number.isFinite(feed.positionS.value) ? feed.positionS.value : fromS}
          onSeek={(timeS) => void feed.seek(timeS)}
          isLooking={feed.looking.value}
        />
      )}
    </section>
  );
}

interface TimeLineProps {
  /** When something touched. */
  spans: readonly ContactSpan[];
  fromS: number;
  toS: number;
  positionS: number;
  onSeek: (timeS: number) => void;
  /** Not all spans are known yet. */
  isLooking?: boolean;
}

function TimeLine({ spans, fromS, toS, positionS, onSeek, isLooking }: TimeLineProps) {
  const app = useApp();
  const track = useRef<HTMLDivElement>(null);
  const sought = useRef(NaN); // where the last key led, which need not be drawn yet
  const link = selectedLink(app);
  const length = Math.max(1e-3, toS - fromS);
  const share = (timeS: number) =>
    `${(100 * Math.min(1, Math.max(0, (timeS - fromS) / length))).toFixed(3)}%`;
  useEffect(() => void (sought.current = NaN), [positionS]);
  const seekTo = (clientX: number) => {
    const box = track.current!.getBoundingClientRect();
    onSeek(fromS + Math.min(1, Math.max(0, (clientX - box.left) / box.width)) * length);
  };
  const steer = (event: KeyboardEvent) => {
    const steps: Record<string, number> = {
      ArrowLeft: -1,
      ArrowDown: -1,
      ArrowRight: 1,
      ArrowUp: 1,
      PageDown: -10,
      PageUp: 10,
      Home: -Infinity,
      End: Infinity,
    };
    const step = steps[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const now = Number.isFinite(sought.current) ? sought.current : positionS;
    sought.current = Math.min(toS, Math.max(fromS, now + step));
    onSeek(sought.current);
  };
  return (
    <div
      ref={track}
      class="track"
      role="slider"
      tabIndex={0}
      aria-label={`Time; ${spans.length} contacts are marked`}
      aria-valuemin={0}
      aria-valuemax={Math.round(length)}
      aria-valuenow={Math.round(positionS - fromS)}
      aria-valuetext={clockTime(positionS)}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        seekTo(event.clientX);
      }}
      onPointerMove={(event) =>
        event.currentTarget.hasPointerCapture(event.pointerId) && seekTo(event.clientX)
      }
      onKeyDown={steer}
    >
      {spans.map((span) => (
        <span
          class={span.link === link ? "span own" : "span"}
          style={{
            left: share(span.fromS),
            width: `max(2px, ${(100 * (span.toS - Math.max(fromS, span.fromS))) / length}%)`,
          }}
          title={`${span.link} #${span.id}: ${span.peakN.toFixed(2)} N at ${clockTime(span.fromS)}`}
        />
      ))}
      <span class="cursor" style={{ left: share(positionS) }} />
      {isLooking && <span class="small looking">looking for contacts …</span>}
    </div>
  );
}
