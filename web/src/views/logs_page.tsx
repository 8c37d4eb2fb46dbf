import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Log, StrongestContact } from "../api/gen/taclink/v1/recording_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { chooseLogs, durationNs, type LogKey, type LogOrder } from "../model/log_list";
import { Dialog } from "../ui/dialog";
import { colourTable } from "../skin/colour_map";
import { bytes, dateTime, duration, fixed, newtons, secondsOf } from "../ui/format";
import { OperatorButton, useRefusal } from "../ui/operator_button";
import { FlatPainter } from "./flat_painter";

const COLUMNS: [LogKey, string][] = [
  ["name", "Log"],
  ["start", "Begins"],
  ["duration", "Duration"],
  ["bytes", "Size"],
  ["frames", "Frames"],
  ["contacts", "Contacts"],
];
const STRONG_N = 1;
const SPARK_WIDTH = 120;
const SPARK_HEIGHT = 28;
const LEAST_RANGE_M = 1e-3;
const STEPS = 255; // of StrongestContact.displacements
const LEAD_S = 1; // that is shown before the strongest contact

/** The logs of the server. */
export function LogsPage() {
  const app = useApp();
  const logs = useSignal<readonly Log[] | undefined>(undefined);
  const trouble = useSignal("");
  const filter = useSignal("");
  const order = useSignal<LogOrder>({ key: "start", descending: true });
  const deleting = useSignal<Log | undefined>(undefined);

  const load = async () => {
    try {
      logs.value = (await app.session.recording.listLogs({}, { timeoutMs: 20_000 })).logs;
      trouble.value = "";
    } catch (error) {
      trouble.value = messageOf(error);
    }
  };
  useEffect(() => void load(), [app.session.generation.value]);

  const sort = (key: LogKey) => {
    const now = order.value;
    order.value = { key, descending: now.key === key ? !now.descending : key !== "name" };
  };
  const shown = chooseLogs(logs.value ?? [], filter.value, order.value);
  return (
    <main tabIndex={-1} class="logs">
      <header class="row">
        <h2>Logs</h2>
        <label>
          <span class="hidden-text">Filter</span>
          <input
            type="search"
            placeholder="Name, note or link"
            value={filter.value}
            onInput={(event) => (filter.value = event.currentTarget.value)}
          />
        </label>
        <button type="button" onClick={() => void load()}>
          Refresh
        </button>
        <span class="small" role="status">
          {logs.value && `${shown.length} of ${logs.value.length}`}
        </span>
      </header>
      {trouble.value && (
        <p role="alert" class="refusal">
          {trouble.value}
        </p>
      )}
      <div class="scroller" tabIndex={0} role="region" aria-label="List of logs">
        <table>
          <thead>
            <tr>
              {COLUMNS.map(([key, title]) => (
                <th scope="col" aria-sort={sortOf(order.value, key)}>
                  <button type="button" class="plain" onClick={() => sort(key)}>
                    {title}
                    <span aria-hidden="true">{mark(order.value, key)}</span>
                  </button>
                </th>
              ))}
              <th scope="col">Force</th>
              <th scope="col">Strongest</th>
              <th scope="col">Links</th>
              <th scope="col">
                <span class="hidden-text">What to do</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {shown.map((log) => (
              <LogRow key={log.name} log={log} onDelete={() => (deleting.value = log)} />
            ))}
          </tbody>
        </table>
        {logs.value && shown.length === 0 && (
          <p class="empty">
            {logs.value.length === 0
              ? "There are no logs yet. Press Record above, or run `taclink record start`."
              : "No log holds these words."}
          </p>
        )}
      </div>
      {deleting.value && (
        <DeleteDialog
          log={deleting.value}
          onClose={() => {
            deleting.value = undefined;
            void load();
          }}
        />
      )}
    </main>
  );
}

const sortOf = (order: LogOrder, key: LogKey) =>
  order.key !== key ? undefined : order.descending ? "descending" : "ascending";
const mark = (order: LogOrder, key: LogKey) => (order.key !== key ? "" : order.descending ? " ▾" : " ▴");

function LogRow({ log, onDelete }: { log: Log; onDelete: () => void }) {
  const app = useApp();
  const refusal = useRefusal();
  const loading = useSignal<number | undefined>(undefined); // share
  const download = async () => {
    const life = new AbortController();
    loading.value = 0;
    try {
      await save(app.session, log, (share) => (loading.value = share), life.signal);
    } catch (error) {
      app.tell(`Download of ${log.name}: ${messageOf(error)}`, true);
    }
    loading.value = undefined;
  };
  return (
    <tr data-log={log.name}>
      <th scope="row">
        {log.name}
        {log.open && <span class="status s2"> being written</span>}
        {log.pictures && <span class="small"> with pictures</span>}
        {log.note && <div class="small">{log.note}</div>}
        {log.problem && <div class="small bad">{log.problem}</div>}
      </th>
      <td class="numbers">{dateTime(secondsOf(log.startUtcNs))}</td>
      <td class="numbers">{durationNs(log) > 0n ? duration(secondsOf(durationNs(log))) : "–"}</td>
      <td class="numbers">{bytes(log.bytes)}</td>
      <td class="numbers">{String(log.frames)}</td>
      <td class="numbers">{log.contacts === undefined ? "–" : String(log.contacts)}</td>
      <td>{log.summary && <Sparkline peaks={log.summary.peakMagnitudeN} />}</td>
      <td>
        {log.summary?.strongest && (
          <button
            type="button"
            class="plain strongest"
            aria-label={`Play ${log.name} at its strongest contact`}
            onClick={() => app.play(log.name, secondsOf(log.summary!.strongest!.logUtcNs) - LEAD_S)}
          >
            <Strongest contact={log.summary.strongest} />
          </button>
        )}
      </td>
      <td class="small">{log.links.join(", ")}</td>
      <td>
        <div class="row">
          <button
            type="button"
            class="primary"
            onClick={() => app.play(log.name)}
            aria-label={`Play ${log.name}`}
          >
            Play
          </button>
          <button
            type="button"
            onClick={() => void download()}
            disabled={loading.value !== undefined}
            aria-label={`Download ${log.name}`}
          >
            {loading.value === undefined ? "Download" : `${Math.round(100 * loading.value)} %`}
          </button>
          <OperatorButton onClick={onDelete} disabled={log.open || refusal !== ""}>
            Delete<span class="hidden-text"> {log.name}</span>
          </OperatorButton>
        </div>
      </td>
    </tr>
  );
}

/** Force over the log, drawn over the same range for all. */
function Sparkline({ peaks }: { peaks: readonly number[] }) {
  const known = peaks.filter((peak) => !Number.isNaN(peak));
  if (known.length === 0) return null;
  const strongest = Math.max(...known);
  const top = Math.max(STRONG_N, strongest);
  const width = SPARK_WIDTH / peaks.length;
  return (
    <svg
      class="sparkline"
      width={SPARK_WIDTH}
      height={SPARK_HEIGHT}
      role="img"
      aria-label={`Force over time, at most ${newtons(strongest)}`}
    >
      {peaks.map((peak, i) => {
        const height = Number.isNaN(peak) ? 0 : Math.max(1, (SPARK_HEIGHT * peak) / top);
        return (
          <rect x={i * width} y={SPARK_HEIGHT - height} width={Math.max(1, width - 0.5)} height={height} />
        );
      })}
    </svg>
  );
}

/** The skin at the strongest contact, laid flat, and where that is. */
function Strongest({ contact }: { contact: StrongestContact }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { paths, rings, displacements, largestDisplacementM: largestM } = contact;
  const isWhole = paths > 0 && rings > 0 && displacements.length === paths * rings;
  useEffect(() => {
    if (!isWhole) return;
    const painter = new FlatPainter(canvas.current!, paths, rings, 2);
    const lengthsM = Array.from(displacements, (step) => (largestM * step) / STEPS);
    painter.paint(lengthsM, Math.max(LEAST_RANGE_M, largestM), colourTable("skin"));
  }, [contact]);
  const { angleRad } = contact;
  const place =
    angleRad === undefined ? "all around" : `${(((angleRad * 180) / Math.PI + 360) % 360).toFixed(0)}°`;
  return (
    <>
      {isWhole && <canvas ref={canvas} aria-hidden="true" />}
      <span class="numbers small">
        {newtons(contact.magnitudeN)} on {contact.link}, {place}, z {fixed(contact.zM * 1e3, 0)} mm
      </span>
    </>
  );
}

function DeleteDialog({ log, onClose }: { log: Log; onClose: () => void }) {
  const app = useApp();
  const remove = async () => {
    try {
      await app.session.recording.deleteLog({ log: log.name });
      app.tell(`${log.name} is deleted.`);
    } catch (error) {
      app.tell(`Delete ${log.name}: ${messageOf(error)}`, true);
    }
    onClose();
  };
  return (
    <Dialog title="Delete a log" onClose={onClose}>
      <p>
        Delete <strong>{log.name}</strong> ({bytes(log.bytes)}) from the server? It can't be brought back.
      </p>
      <div class="dialog-foot">
        <button type="button" class="danger" onClick={() => void remove()}>
          Delete
        </button>
        <button type="button" onClick={onClose}>
          Keep it
        </button>
      </div>
    </Dialog>
  );
}

interface SaveFilePicker {
  showSaveFilePicker?: (options: { suggestedName: string }) => Promise<FileSystemFileHandle>;
}

// To the disk piece by piece where the browser can; else by way of memory.
async function save(
  session: ReturnType<typeof useApp>["session"],
  log: Log,
  onProgress: (share: number) => void,
  stop: AbortSignal,
): Promise<void> {
  const picker = (window as SaveFilePicker).showSaveFilePicker;
  const large = log.bytes > 200_000_000n;
  const file = picker && large ? await picker({ suggestedName: log.name }) : undefined;
  const disk = await file?.createWritable();
  const pieces: BlobPart[] = [];
  for await (const { data, offset, size } of session.recording.downloadLog(
    { log: log.name },
    { signal: stop },
  )) {
    const piece = data as Uint8Array<ArrayBuffer>;
    if (disk) await disk.write(piece);
    else pieces.push(piece);
    onProgress(size > 0n ? Number(offset + BigInt(data.length)) / Number(size) : 1);
  }
  if (disk) return disk.close();
  const address = URL.createObjectURL(new Blob(pieces));
  const anchor = document.createElement("a");
  anchor.href = address;
  anchor.download = log.name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
