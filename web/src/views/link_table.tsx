import { useSignal } from "@preact/signals";
import { PressureOrigin } from "../api/gen/taclink/v1/pressure_pb";
import { Supervision, type Link } from "../api/gen/taclink/v1/arm_pb";
import { ForceLevel } from "../api/gen/taclink/v1/events_pb";
import { LinkStatus, Reason } from "../api/gen/taclink/v1/frame_pb";
import type { Baseline } from "../api/gen/taclink/v1/tare_pb";
import { selectedLink, useApp } from "../app_state";
import { totalMagnitudeN } from "../model/magnitude";
import { duration, fixed, milliseconds, newtons, PASCALS_PER_KPA } from "../ui/format";
import { OperatorButton } from "../ui/operator_button";
import { LEVEL_WORDS, MODEL_WORDS, severity, STATUS_SIGNS, STATUS_WORDS, statusOf } from "../ui/words";

import { TareDialog } from "./tare_dialog";

/** A row for each link; what needs attention is above. */
export function LinkTable() {
  const app = useApp();
  const store = app.store.value;
  store.beat.value;
  const taring = useSignal(false);
  const isPast = store.lookedAtS.value !== undefined;
  const links = store.arm.value?.links ?? [];
  const rows = links
    .map((link) => {
      const { newest } = store.link(link.name);
      const { status, reason } = statusOf(link, newest);
      const level = isPast ? ForceLevel.UNSPECIFIED : store.levelOf(link.name);
      return { link, status, reason, level, weight: severity(status, level, link.supervision) };
    })
    .sort((a, b) => b.weight - a.weight || a.link.index - b.link.index);
  return (
    <section class="links" aria-label="Links">
      <div class="scroller" tabIndex={0} role="region" aria-label="Links and how they do">
        <table>
          <thead>
            <tr>
              <th scope="col">Link</th>
              <th scope="col">Status</th>
              <th scope="col">
                <abbr title="Sum of what all contacts press or drag with; opposite ones do not cancel">
                  Force
                </abbr>
              </th>
              <th scope="col">Rate</th>
              <th scope="col">
                <abbr title="From exposure to clients, median / 99th percentile">Latency</abbr>
              </th>
              <th scope="col">Markers</th>
              <th scope="col">Pressure</th>
              <th scope="col">Baseline</th>
              <th scope="col">Model</th>
              <th scope="col">
                <abbr title="Frames not solved by the server / not delivered to this page">Drops</abbr>
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map((row) => (
              <Row key={row.link.name} {...row} selected={row.link.name === selectedLink(app)} />
            ))}
          </tbody>
        </table>
        {links.length > 1 && (
          <p class="row">
            <OperatorButton onClick={() => (taring.value = true)}>Tare all links …</OperatorButton>
          </p>
        )}
        {taring.value && <TareDialog links={links} onClose={() => (taring.value = false)} />}
        {links.length === 0 && (
          <p class="empty">No link yet. The server's configuration names them under `links`.</p>
        )}
      </div>
    </section>
  );
}

function Row(props: { link: Link; status: LinkStatus; reason: string; level: number; selected: boolean }) {
  const app = useApp();
  const { link, status, reason, level } = props;
  const record = app.store.value.link(link.name);
  const frame = record.newest;
  const others = (frame?.statusReasons ?? []).map((each) => each.text).filter((text) => text !== reason);
  const late = frame?.statusReasons.find((each) => each.reason === Reason.LATE_FRAME);
  // Those are of now.
  const statistics = app.store.value.lookedAtS.value === undefined ? link.statistics : undefined;
  const grid = link.model?.markers;
  const level_word = LEVEL_WORDS[level as keyof typeof LEVEL_WORDS];
  return (
    <tr
      class={props.selected ? "selected" : ""}
      data-link={link.name}
      onClick={() => (app.link.value = link.name)}
    >
      <th scope="row">
        <button
          type="button"
          class="plain"
          aria-pressed={props.selected}
          onClick={() => (app.link.value = link.name)}
        >
          {link.name}
        </button>
      </th>
      <td>
        <span class={`status s${status}`}>
          <span aria-hidden="true">{STATUS_SIGNS[status]}</span> {STATUS_WORDS[status]}
        </span>
        {link.supervision > Supervision.RUNNING && <span class="status s5"> worker</span>}
        {reason && (
          <div class="reason" title={[reason, ...others].join("\n")}>
            {reason}
            {others.length > 0 && ` (and ${others.length} more)`}
          </div>
        )}
      </td>
      <td class={`numbers level${level}${frame && frame.contacts.length > 0 ? " touched" : ""}`}>
        {frame && status !== LinkStatus.LOST ? newtons(totalMagnitudeN(frame)) : "–"}
        {level_word && <span class="level-word"> {level_word}</span>}
      </td>
      <td class="numbers">{statistics?.rateHz ? `${fixed(statistics.rateHz, 1)}/s` : "–"}</td>
      <td class="numbers">
        {milliseconds(statistics?.latencyP50S)} / {milliseconds(statistics?.latencyP99S)}
        {late?.value !== undefined && (
          <div class="bad" title={late.text}>
            frame {duration(late.value)} old
          </div>
        )}
      </td>
      <td class="numbers">
        {frame ? frame.markersSeen : "–"}/{grid ? grid.paths * grid.rings : "–"}
      </td>
      <td class="numbers">
        <Pressure link={link} />
      </td>
      <td
        class="numbers"
        title={frame?.baseline ? sinceBaseline(frame.baseline, frame.cameraShiftM) : undefined}
      >
        {frame && frame.markersSeen > 0 ? duration(frame.baselineAgeS) : "–"}
      </td>
      <td>{frame ? MODEL_WORDS[frame.forceModel] : "–"}</td>
      <td class="numbers">
        {String(statistics?.framesSkipped ?? 0n)} / {String(record.counts?.framesDropped ?? 0n)}
      </td>
    </tr>
  );
}

function sinceBaseline(baseline: Baseline, cameraShiftM: number | undefined): string {
  const drift = `Drift ${fixed(baseline.driftM * 1e3, 2)} mm`;
  if (cameraShiftM === undefined) return drift;
  return `${drift}; by the cameras' own motion markers would be off by ${fixed(cameraShiftM * 1e3, 2)} mm, which is taken off`;
}

function Pressure({ link }: { link: Link }) {
  const report = useApp().store.value.link(link.name).newest?.pressure;
  if (!report || report.origin === PressureOrigin.NONE)
    return <span title="Nobody tells the pressure: configure pressure_kpa, or a sensor">not known</span>;
  const kpa = fixed(report.pressurePa / PASCALS_PER_KPA, 2);
  const how = report.stale ? ", stale" : report.assumed ? ", assumed" : "";
  return (
    <span title={report.trouble || undefined} class={report.stale ? "bad" : ""}>
      {kpa} kPa{how}
    </span>
  );
}
