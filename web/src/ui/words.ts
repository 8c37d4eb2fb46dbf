import type { DescEnum } from "@bufbuild/protobuf";
import { Supervision, type Link } from "../api/gen/taclink/v1/arm_pb";
import { EventKind, EventKindSchema, ForceLevel, type Event } from "../api/gen/taclink/v1/events_pb";
import { ForceModel, LinkStatus, type LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import { magnitudeN } from "../model/magnitude";
import { newtons } from "./format";

/** The name of a value as the protocol has it: "force model" of EVENT_KIND_FORCE_MODEL. */
export function nameOf(schema: DescEnum, value: number): string {
  const name = value === 0 ? undefined : schema.value[value]?.localName;
  return name?.toLowerCase().replaceAll("_", " ") ?? "unknown";
}

export const STATUS_WORDS: Record<LinkStatus, string> = {
  [LinkStatus.UNSPECIFIED]: "unknown",
  [LinkStatus.STARTING]: "starting",
  [LinkStatus.CALIBRATING]: "calibrating",
  [LinkStatus.OK]: "OK",
  [LinkStatus.DEGRADED]: "degraded",
  [LinkStatus.LOST]: "lost",
};

/** Of more than colour: people who don't see it read the sign. */
export const STATUS_SIGNS: Record<LinkStatus, string> = {
  [LinkStatus.UNSPECIFIED]: "?",
  [LinkStatus.STARTING]: "…",
  [LinkStatus.CALIBRATING]: "…",
  [LinkStatus.OK]: "✓",
  [LinkStatus.DEGRADED]: "!",
  [LinkStatus.LOST]: "✕",
};

export const LEVEL_WORDS: Record<ForceLevel, string> = {
  [ForceLevel.UNSPECIFIED]: "",
  [ForceLevel.NORMAL]: "",
  [ForceLevel.WARNING]: "warning",
  [ForceLevel.ALARM]: "alarm",
};

export const MODEL_WORDS: Record<ForceModel, string> = {
  [ForceModel.UNSPECIFIED]: "–",
  [ForceModel.LINEAR]: "linear",
  [ForceModel.LITERAL]: "literal (for comparison only)",
  [ForceModel.PRESSURISED]: "pressurised",
  [ForceModel.NONLINEAR]: "nonlinear",
  [ForceModel.AUTO]: "cheapest good enough",
};

/** What a model takes into account, in a sentence. */
export const MODEL_NOTES: Record<ForceModel, string> = {
  [ForceModel.UNSPECIFIED]: "",
  [ForceModel.LINEAR]: "Small displacements of a skin without pressure: the quickest.",
  [ForceModel.LITERAL]: "The thesis' formula (6.1); its forces are not right.",
  [ForceModel.PRESSURISED]: "Small displacements about the inflated skin.",
  [ForceModel.NONLINEAR]: "Displacements of any size, and pressure that follows the skin: the most exact.",
  [ForceModel.AUTO]: "In each frame the quickest model that errs by less than 5 % on this skin.",
};

const SEVERITY: Record<LinkStatus, number> = {
  [LinkStatus.LOST]: 4,
  [LinkStatus.DEGRADED]: 3,
  [LinkStatus.STARTING]: 2,
  [LinkStatus.CALIBRATING]: 2,
  [LinkStatus.UNSPECIFIED]: 2,
  [LinkStatus.OK]: 0,
};

/** How much a link needs attention: the higher, the more. */
export function severity(status: LinkStatus, level: ForceLevel, supervision: Supervision): number {
  const worker = supervision > Supervision.RUNNING ? 5 : 0;
  const force = level === ForceLevel.ALARM ? 3.5 : level === ForceLevel.WARNING ? 1 : 0;
  return Math.max(worker, force, SEVERITY[status]);
}

/** Status and reason, of the newest frame where there is one. */
export function statusOf(link: Link, frame: LinkFrame | undefined): { status: LinkStatus; reason: string } {
  if (link.supervision > Supervision.RUNNING && link.supervisionReason)
    return { status: frame?.status ?? link.status, reason: link.supervisionReason };
  return frame
    ? { status: frame.status, reason: frame.statusReason }
    : { status: link.status, reason: link.statusReason };
}

/** An event in one line, with its frame's status where that is not well. */
export function eventText(event: Event): string {
  const isTold = event.detail.case === "contact" || event.detail.case === "forceLevel";
  const isWell = event.frameStatus === LinkStatus.UNSPECIFIED || event.frameStatus === LinkStatus.OK;
  return isTold && !isWell ? `${detailText(event)} (${STATUS_WORDS[event.frameStatus]})` : detailText(event);
}

function detailText(event: Event): string {
  const { detail } = event;
  switch (detail.case) {
    case "contact": {
      const force = newtons(magnitudeN(detail.value));
      const id = `#${detail.value.contactId}`;
      if (event.kind === EventKind.CONTACT_BEGIN) return `contact ${id} began, ${force}`;
      if (event.kind === EventKind.CONTACT_UPDATE) return `contact ${id} is ${force}`;
      const peak = newtons(detail.value.peakForceN);
      return `contact ${id} ended after ${detail.value.durationS.toFixed(1)} s, peak ${peak} (${detail.value.endReason})`;
    }
    case "forceLevel": {
      const region = detail.value.region ? ` in ${detail.value.region}` : "";
      const level = LEVEL_WORDS[detail.value.level] || "normal";
      return `force ${level}${region}: ${newtons(detail.value.forceN)}`;
    }
    case "linkStatus":
      return `${STATUS_WORDS[detail.value.status]}${detail.value.reason ? `: ${detail.value.reason}` : ""}`;
    case "operation": {
      if (event.kind === EventKind.CLOCK_STEPPED) return `clock: ${detail.value.outcome}`;
      if (event.kind === EventKind.PRESSURE_TRIP && !detail.value.accepted)
        return `pressure regulator closed its valve: ${detail.value.outcome}`;
      const end = detail.value.accepted ? "done" : "refused";
      return `${nameOf(EventKindSchema, event.kind)} ${end} by ${detail.value.who}${detail.value.outcome ? `: ${detail.value.outcome}` : ""}`;
    }
    case "drift":
      return `baseline has followed the skin by ${(detail.value.driftM * 1e3).toFixed(2)} mm`;
    case "framesLost":
      return `${detail.value.frames} frames without events: the server was too busy`;
    default:
      return nameOf(EventKindSchema, event.kind);
  }
}
