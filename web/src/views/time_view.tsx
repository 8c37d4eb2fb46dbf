import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { EventKind, ForceLevel, type Event, type Thresholds } from "../api/gen/taclink/v1/events_pb";
import { selectedLink, useApp } from "../app_state";
import type { ArmStore } from "../model/arm_store";
import { binTimes } from "../model/force_history";
import { clockTime, newtons, secondsOf } from "../ui/format";

const SPANS_S = [10, 60, 300, 1200];
const BINS = 400;
const REDRAW_MS = 125;
// A link at rest tells its force once a second.
const HOLD_S = 2.5;
const MOST_CONTACTS = 8;
const LEAST_TOP_N = 0.4;
const DRAG_PX = 5; // less is a click
const LATE_BINS = 25;
const LEGEND_PX = 30;
/** Told apart also by colour-blind people (Okabe and Ito), and by dashes from the ninth on. */
const LINE_COLOURS = ["#56b4e9", "#e69f00", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#999999"];

type What = "links" | "contacts";

/** Forces over time, with thresholds and events. */
export function TimeView() {
  const app = useApp();
  const store = app.store.value;
  const host = useRef<HTMLDivElement>(null);
  const span = useSignal(60);
  const what = useSignal<What>("links");
  const paused = useSignal<number | undefined>(undefined); // right end, s
  const zoom = useSignal<[number, number] | undefined>(undefined);
  const link = selectedLink(app);

  useEffect(() => {
    const onZoom = (from: number, to: number) => {
      paused.value ??= to;
      zoom.value = [from, to];
    };
    const chart = new ForceChart(host.current!, onZoom, (timeS) => app.seek(timeS));
    let drawn = "";
    let stood: number | undefined;
    const draw = () => {
      if (document.hidden) return;
      const shownS = app.shownS();
      // The curves stand still while one looks back.
      if (store.lookedAtS.peek() === undefined) stood = undefined;
      else stood ??= store.nowS();
      const end = paused.value ?? stood ?? store.nowS();
      const [from, to] = zoom.value ?? [end - span.value, end];
      const view = `${from} ${to} ${shownS}`;
      if (paused.value !== undefined && view === drawn) return; // what comes late would change it yet
      drawn = view;
      if (Number.isFinite(from)) chart.show(collect(store, what.value, link, from, to), from, to, shownS);
    };
    draw();
    const timer = setInterval(draw, REDRAW_MS);
    return () => {
      clearInterval(timer);
      chart.destroy();
    };
  }, [store, link, what.value, span.value]);

  const pause = () => (paused.value = paused.value === undefined ? store.nowS() : undefined);
  const goOn = () => {
    zoom.value = undefined;
    paused.value = undefined;
  };
  return (
    <section class="time" aria-label="Forces over time">
      <header>
        <h2>Force</h2>
        <div role="group" aria-label="What is drawn" class="choice">
          {(["links", "contacts"] as const).map((each) => (
            <button type="button" aria-pressed={what.value === each} onClick={() => (what.value = each)}>
              {each === "links" ? "All links" : `Contacts of ${link}`}
            </button>
          ))}
        </div>
        <div role="group" aria-label="Time shown" class="choice">
          {SPANS_S.map((each) => (
            <button
              type="button"
              aria-pressed={span.value === each && !zoom.value}
              onClick={() => ((span.value = each), (zoom.value = undefined))}
            >
              {each < 60 ? `${each} s` : `${each / 60} min`}
            </button>
          ))}
        </div>
        <button type="button" aria-pressed={paused.value !== undefined} onClick={zoom.value ? goOn : pause}>
          {zoom.value ? "Show newest" : paused.value === undefined ? "Pause" : "Go on"}
        </button>
        <span class="small hint">Click on the curves: show that moment. Drag: zoom.</span>
      </header>
      <div
        ref={host}
        class="chart"
        role="img"
        aria-label={`Total force of each link over the last ${span.value} s`}
      />
    </section>
  );
}

interface Curves {
  names: string[];
  data: uPlot.AlignedData;
  thresholds: Thresholds | undefined;
  events: readonly Event[];
}

function collect(store: ArmStore, what: What, link: string, fromS: number, toS: number): Curves {
  const arm = store.arm.value;
  const times = binTimes(fromS, toS, BINS);
  const events = store.events.value.filter((event) => {
    const at = secondsOf(event.times?.exposureUtcNs || event.times?.raisedUtcNs || 0n);
    return at >= fromS && at <= toS && event.kind !== EventKind.CONTACT_UPDATE;
  });
  if (what === "contacts") {
    // Each contact is compared with them, not what all of them press together.
    const thresholds = arm?.links.find((each) => each.name === link)?.forceLevels[0]?.thresholds;
    const contacts = store.link(link).history.contactsIn(fromS, toS, BINS, MOST_CONTACTS);
    const names = [...contacts.keys()].map((id) => `#${id}`);
    const own = events.filter((event) => event.link === link);
    return { names, data: [times, ...contacts.values()], thresholds, events: own };
  }
  const names = arm?.links.map((each) => each.name) ?? [];
  const series = names.map((name) => store.link(name).history.totalsIn(fromS, toS, BINS, HOLD_S));
  return { names, data: [times, ...series], thresholds: undefined, events };
}

/** The chart; made again when there are other curves. */
class ForceChart {
  private plot: uPlot | undefined;
  private names = "";
  private curves: Curves | undefined;
  private shownS: number | undefined;
  private top = LEAST_TOP_N;
  private readonly sizes: ResizeObserver;

  constructor(
    private readonly host: HTMLElement,
    private readonly onZoom: (from: number, to: number) => void,
    private readonly onPick: (timeS: number) => void,
  ) {
    this.sizes = new ResizeObserver(() => this.plot?.setSize(this.size()));
    this.sizes.observe(host);
  }

  destroy(): void {
    this.sizes.disconnect();
    this.plot?.destroy();
  }

  /** `shownS`: the moment that the rest of the page shows; undefined: now. */
  show(curves: Curves, from: number, to: number, shownS: number | undefined): void {
    this.curves = curves;
    this.shownS = shownS;
    const names = curves.names.join("\n");
    if (!this.plot || names !== this.names) this.make(names);
    let top = LEAST_TOP_N;
    for (const series of curves.data.slice(1))
      for (const value of series) if (value && value > top) top = value;
    // Falls only when it is far too high, so that the axis does not jump.
    if (top > this.top || top < this.top / 4) this.top = top * 1.25;
    this.plot!.batch(() => {
      this.plot!.setData(curves.data, false);
      this.plot!.setScale("x", { min: from, max: to });
      this.plot!.setScale("y", { min: 0, max: this.top });
    });
    this.showValues(shownS);
  }

  // In the legend: of the moment that is shown, where the pointer is not over the curves.
  private showValues(shownS: number | undefined): void {
    const plot = this.plot!;
    if ((plot.cursor.left ?? -1) >= 0) return;
    plot.setLegend({ idx: shownS === undefined ? plot.data[0].length - 1 : plot.valToIdx(shownS) }, false);
  }

  // What is newest comes late, of each link at another time.
  private valueAt(series: number, idx: number | null): number | undefined {
    const values = this.plot!.data[series];
    if (idx === null) return undefined;
    const isNewest = idx === values.length - 1;
    for (let at = idx; at >= 0 && at >= idx - (isNewest ? LATE_BINS : 0); --at)
      if (values[at] !== null && values[at] !== undefined) return values[at]!;
    return undefined;
  }

  // It has a row or several.
  private legendHeight(): number {
    return this.host.querySelector<HTMLElement>(".u-legend")?.offsetHeight ?? LEGEND_PX;
  }

  private size() {
    return {
      width: Math.max(200, this.host.clientWidth),
      height: Math.max(120, this.host.clientHeight - this.legendHeight()),
    };
  }

  private make(names: string): void {
    this.names = names;
    this.plot?.destroy();
    const style = getComputedStyle(this.host);
    const ink = style.getPropertyValue("--ink-soft").trim() || "#888";
    const line = style.getPropertyValue("--line").trim() || "#8884";
    const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 } };
    let pressedAt = NaN;
    this.plot = new uPlot(
      {
        ...this.size(),
        scales: { x: { time: true, auto: false }, y: { auto: false } },
        axes: [
          {
            ...axis,
            space: 70,
            values: (_: uPlot, splits: number[]) => splits.map((at) => clockTime(at).slice(0, 8)),
          },
          { ...axis, label: "N", size: 46, labelSize: 18 },
        ],
        legend: { live: true },
        cursor: { drag: { x: true, y: false, setScale: false } },
        series: [{}, ...this.lines(names)],
        hooks: {
          draw: [(plot) => this.marks(plot)],
          ready: [
            (plot) =>
              plot.over.addEventListener("click", (event) => {
                if (Math.abs(event.offsetX - pressedAt) < DRAG_PX)
                  this.onPick(plot.posToVal(event.offsetX, "x"));
              }),
            (plot) => plot.over.addEventListener("pointerdown", (event) => (pressedAt = event.offsetX)),
          ],
          setSelect: [
            (plot) => {
              const { left, width } = plot.select;
              if (width < DRAG_PX) return;
              this.onZoom(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
              plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      this.curves!.data,
      this.host,
    );
    this.plot.setSize(this.size());
  }

  private lines(names: string): uPlot.Series[] {
    if (!names) return [];
    return names.split("\n").map((label, i) => ({
      label,
      stroke: LINE_COLOURS[i % LINE_COLOURS.length],
      dash: i >= LINE_COLOURS.length ? [6, 3] : undefined,
      width: 1.5,
      points: { show: false },
      value: (_: uPlot, __: number, series: number, idx: number | null) =>
        newtons(this.plot && this.valueAt(series, idx)),
    }));
  }

  // Thresholds as lines across, events as ticks at the top.
  private marks(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const thresholds = this.curves?.thresholds;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const across = (value: number, colour: string, word: string) => {
      if (value <= 0) return;
      const y = plot.valToPos(value, "y", true);
      ctx.strokeStyle = ctx.fillStyle = colour;
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash([8, 5]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      ctx.setLineDash([]);
      ctx.textAlign = "left";
      ctx.textBaseline = "alphabetic";
      ctx.font = `${11 * devicePixelRatio}px system-ui`;
      ctx.fillText(word, bbox.left + 4 * devicePixelRatio, y - 3 * devicePixelRatio);
    };
    across(thresholds?.warningN ?? 0, "#e69f00", "warning");
    across(thresholds?.alarmN ?? 0, "#e5484d", "alarm");
    for (const event of this.curves?.events ?? []) {
      const x = plot.valToPos(
        secondsOf(event.times?.exposureUtcNs || event.times?.raisedUtcNs || 0n),
        "x",
        true,
      );
      ctx.fillStyle = eventColour(event);
      ctx.fillRect(x - devicePixelRatio, bbox.top, 2 * devicePixelRatio, 8 * devicePixelRatio);
    }
    if (this.shownS !== undefined) {
      ctx.fillStyle = getComputedStyle(this.host).getPropertyValue("--mark");
      ctx.fillRect(
        plot.valToPos(this.shownS, "x", true) - devicePixelRatio,
        bbox.top,
        2 * devicePixelRatio,
        bbox.height,
      );
    }
    ctx.restore();
  }
}

function eventColour(event: Event): string {
  if (event.detail.case === "forceLevel") {
    if (event.detail.value.level === ForceLevel.ALARM) return "#e5484d";
    if (event.detail.value.level === ForceLevel.WARNING) return "#e69f00";
  }
  if (event.kind === EventKind.CONTACT_BEGIN) return "#56b4e9";
  return "#999999";
}
