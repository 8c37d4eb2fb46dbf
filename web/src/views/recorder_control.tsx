import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { RecorderState, type RecorderStatus } from "../api/gen/taclink/v1/recording_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";
import { bytes, duration, secondsOf } from "../ui/format";
import { OperatorButton } from "../ui/operator_button";

const PERIOD_MS = 2000;

/** Starts and stops recordings, and says how the recorder does. */
export function RecorderControl() {
  const app = useApp();
  const status = useSignal<RecorderStatus | undefined>(undefined);
  const asking = useSignal(false);
  const connected = app.feed.value.connection.value.state === "live" && !app.log.value;

  const look = async () => {
    try {
      status.value = (await app.session.recording.getRecorder({}, { timeoutMs: 5000 })).status;
    } catch {
      status.value = undefined; // the connection says why
    }
  };
  useEffect(() => {
    if (!connected) return;
    void look();
    const timer = setInterval(() => {
      if (!document.hidden) void look();
    }, PERIOD_MS);
    return () => clearInterval(timer);
  }, [connected]);

  const stop = async () => {
    try {
      const end = await app.session.recording.stopRecording({}, { timeoutMs: 20_000 });
      status.value = end.status;
      app.tell(`Recorded ${end.status?.log} (${bytes(end.status?.bytes ?? 0)}).`);
    } catch (error) {
      app.tell(`Stop: ${messageOf(error)}`, true);
    }
  };

  const now = status.value;
  if (!connected || !now) return null;
  const recording = now.state === RecorderState.RECORDING || now.state === RecorderState.TROUBLE;
  const since = Date.now() / 1e3 - secondsOf(now.startedUtcNs);
  return (
    <div class="recorder">
      {recording ? (
        <>
          <span class={`record-sign${now.state === RecorderState.TROUBLE ? " bad" : ""}`} role="status">
            <span aria-hidden="true">●</span> Recording
          </span>{" "}
          <span class="numbers small">
            {duration(since)}, {bytes(now.bytes)}
            {now.framesLost > 0n && `, ${now.framesLost} frames lost`}
          </span>
          <OperatorButton onClick={() => void stop()}>Stop</OperatorButton>
          <Trouble now={now} />
        </>
      ) : (
        <>
          <OperatorButton onClick={() => (asking.value = true)}>● Record</OperatorButton>
          <Trouble now={now} />
        </>
      )}
      {asking.value && <StartDialog status={now} onClose={() => ((asking.value = false), void look())} />}
    </div>
  );
}

/** What is wrong, or was since the recording began: what it lost stays lost. */
function Trouble({ now }: { now: RecorderStatus }) {
  if (now.trouble) return <span class="bad small">{now.trouble}</span>;
  if (!now.lastTrouble) return null;
  const time = new Date(secondsOf(now.lastTroubleUtcNs) * 1e3).toLocaleTimeString();
  return (
    <span class="bad small" title={now.lastTrouble}>
      trouble at {time}
    </span>
  );
}

function StartDialog({ status, onClose }: { status: RecorderStatus; onClose: () => void }) {
  const app = useApp();
  const trouble = useSignal("");
  const start = async (form: HTMLFormElement) => {
    const data = new FormData(form);
    try {
      await app.session.recording.startRecording({
        name: String(data.get("name") ?? ""),
        note: String(data.get("note") ?? ""),
        pictures: data.get("pictures") !== null,
      });
      onClose();
    } catch (error) {
      trouble.value = messageOf(error);
    }
  };
  return (
    <Dialog title="Record" onClose={onClose}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void start(event.currentTarget);
        }}
      >
        <p class="small">
          {status.folder
            ? `On the server, in ${status.folder}; ${bytes(status.freeBytes)} are free.`
            : "The server's configuration names no folder: set recording.folder there."}
        </p>
        <label class="block">
          Name <input name="name" maxLength={64} pattern="[A-Za-z0-9_\-]*" placeholder="the arm's" />
        </label>
        <label class="block">
          Note <input name="note" maxLength={4096} />
        </label>
        <label class="block">
          <input type="checkbox" name="pictures" /> with the cameras' pictures (much larger; can be solved
          again)
        </label>
        {trouble.value && (
          <p role="alert" class="refusal">
            {trouble.value}
          </p>
        )}
        <div class="dialog-foot">
          <button type="submit" class="primary">
            Record
          </button>
          <button type="button" onClick={onClose}>
            Cancel
          </button>
        </div>
      </form>
    </Dialog>
  );
}
