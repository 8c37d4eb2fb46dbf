import { useSignal } from "@preact/signals";
import { EventKind, ForceLevel, type Event } from "../api/gen/taclink/v1/events_pb";
import { useApp } from "../app_state";
import { touchesOf } from "../model/touches";
import { clockTime, duration, newtons, secondsOf } from "../ui/format";
import { eventText } from "../ui/words";

const SHOWN = 100;

type Shown = "touches" | "other" | "all";

const CONTACT_KINDS = new Set([EventKind.CONTACT_BEGIN, EventKind.CONTACT_UPDATE, EventKind.CONTACT_END]);

/** What happened, newest first: touches as one row each, and the rest as it was reported. */
export function EventList() {
  const app = useApp();
  const store = app.store.value;
  const shown = useSignal<Shown>("touches");
  const link = useSignal("");
  const ofLink = store.events.value.filter((event) => !link.value || event.link === link.value);
  const others = ofLink.filter((event) => shown.value === "all" || !CONTACT_KINDS.has(event.kind));
  return (
    <section class="events" aria-label="Events">
      <header>
        <h2>Events</h2>
        <label>
          <span class="hidden-text">Which events</span>
          <select
            value={shown.value}
            onChange={(event) => (shown.value = event.currentTarget.value as Shown)}
          >
            <option value="touches">touches</option>
            <option value="other">links and operators</option>
            <option value="all">all</option>
          </select>
        </label>
        <label>
          <span class="hidden-text">Of which link</span>
          <select value={link.value} onChange={(event) => (link.value = event.currentTarget.value)}>
            <option value="">all links</option>
            {(store.arm.value?.links ?? []).map((each) => (
              <option value={each.name}>{each.name}</option>
            ))}
          </select>
        </label>
      </header>
      {shown.value === "touches" ? <Touches events={ofLink} /> : <Others events={others} />}
    </section>
  );
}

function Nothing() {
  const app = useApp();
  return (
    <li class="empty">{app.log.value ? "No event here." : "Nothing has happened yet. Touch a skin."}</li>
  );
}

function Others({ events }: { events: readonly Event[] }) {
  return (
    <ol class="scroller" tabIndex={0} aria-label="Events, newest first">
      {events.slice(0, SHOWN).map((event) => (
        <Row key={`${event.sequence}`} event={event} />
      ))}
      {events.length === 0 && <Nothing />}
    </ol>
  );
}

function Touches({ events }: { events: readonly Event[] }) {
  const app = useApp();
  const store = app.store.value;
  store.beat.value;
  const touches = touchesOf(events);
  return (
    <ol class="scroller touches" tabIndex={0} aria-label="Touches, newest first">
      {touches.slice(0, SHOWN).map((touch) => (
        <li key={`${touch.link} ${touch.id} ${touch.beginS}`} class="event">
          <time class="numbers">{clockTime(touch.beginS)}</time>{" "}
          <button type="button" class="plain" onClick={() => (app.link.value = touch.link)}>
            {touch.link}
          </button>{" "}
          <span class="numbers">
            peak {newtons(touch.peakN)}, {touch.durationS === undefined ? "now" : duration(touch.durationS)}
          </span>
          {touch.isDoubted && <span class="small"> in doubt</span>}
        </li>
      ))}
      {touches.length === 0 && <Nothing />}
    </ol>
  );
}

function Row({ event }: { event: Event }) {
  const app = useApp();
  const timeS = secondsOf(event.times?.exposureUtcNs || event.times?.raisedUtcNs || 0n);
  const level = event.detail.case === "forceLevel" ? event.detail.value.level : ForceLevel.NORMAL;
  return (
    <li class={`event level${level} kind${event.kind}`}>
      <time class="numbers">{clockTime(timeS)}</time>{" "}
      {event.link && (
        <button type="button" class="plain" onClick={() => (app.link.value = event.link)}>
          {event.link}
        </button>
      )}{" "}
      <span>{eventText(event)}</span>
    </li>
  );
}
