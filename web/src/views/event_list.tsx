import { useSignal } from "@preact/signals";
import { EventKind, ForceLevel, type Event } from "../api/gen/taclink/v1/events_pb";
import { useApp } from "../app_state";
import { clockTime, secondsOf } from "../ui/format";
import { eventText } from "../ui/words";

const SHOWN = 100;

/** What happened, newest first. */
export function EventList() {
  const app = useApp();
  const store = app.store.value;
  const withUpdates = useSignal(false);
  const events = store.events.value.filter(
    (event) =>
      withUpdates.value || (event.kind !== EventKind.CONTACT_UPDATE && event.kind !== EventKind.DRIFT),
  );
  return (
    <section class="events" aria-label="Events">
      <header>
        <h2>Events</h2>
        <label class="small">
          <input
            type="checkbox"
            checked={withUpdates.value}
            onChange={(event) => (withUpdates.value = event.currentTarget.checked)}
          />{" "}
          small changes
        </label>
      </header>
      <ol class="scroller" tabIndex={0} aria-label="Events, newest first">
        {events.slice(0, SHOWN).map((event) => (
          <Row key={`${event.sequence}`} event={event} />
        ))}
        {events.length === 0 && (
          <li class="empty">
            {app.log.value ? "No event here." : "Nothing has happened yet. Touch a skin."}
          </li>
        )}
      </ol>
    </section>
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
