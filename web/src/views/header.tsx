import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Role } from "../api/gen/taclink/v1/operations_pb";
import { ForceLevel } from "../api/gen/taclink/v1/events_pb";
import { LinkStatus } from "../api/gen/taclink/v1/frame_pb";
import { useApp, type Theme } from "../app_state";
import { statusOf } from "../ui/words";
import { KeysHelp } from "./keys_help";
import { RecorderControl } from "./recorder_control";
import { magnitudeN } from "../model/magnitude";
import { clockTime, newtons } from "../ui/format";
import { SignIn } from "./sign_in";

export function Header() {
  const app = useApp();
  const arm = app.store.value.arm.value;
  const replay = app.log.value !== "";
  return (
    <header class="top">
      <h1>
        TacLINK <span class="arm-name">{arm?.name}</span>
        {replay && <span class="replay-word">REPLAY</span>}
      </h1>
      <nav aria-label="Pages">
        <button
          type="button"
          aria-current={app.page.value === "live" ? "page" : undefined}
          onClick={() => (app.page.value = "live")}
        >
          Arm
        </button>
        <button
          type="button"
          aria-current={app.page.value === "logs" ? "page" : undefined}
          onClick={() => (app.page.value = "logs")}
        >
          Logs
        </button>
      </nav>
      <Health />
      <span class="grow" />
      <RecorderControl />
      <ThemeChoice />
      <KeysHelp />
      <User />
    </header>
  );
}

/** The arm in a word: connected, how many links are not well, alarms. Also in the title of the window. */
function Health() {
  const app = useApp();
  const store = app.store.value;
  store.beat.value;
  const { state } = app.feed.value.connection.value;
  const links = store.arm.value?.links ?? [];
  // Also while a past moment is shown: what is wrong now must be seen.
  const unwell = links.filter(
    (link) => statusOf(link, store.link(link.name).now.newest).status !== LinkStatus.OK,
  ).length;
  const alarms = links.filter((link) => store.levelOf(link.name) === ForceLevel.ALARM).length;
  const words = { connecting: "connecting …", lost: "connection lost", signIn: "not signed in", live: "" }[
    state
  ];
  const text =
    words || (unwell === 0 ? `all ${links.length} links OK` : `${unwell} of ${links.length} links not OK`);
  useEffect(() => {
    const mark = state === "lost" ? "✕ " : alarms > 0 ? `(${alarms}) ` : unwell > 0 ? "! " : "";
    document.title = `${mark}${store.arm.value?.name ?? "TacLINK"}${app.log.value ? " – replay" : ""}`;
  }, [state, alarms, unwell, store.arm.value?.name, app.log.value]);
  const kind = state === "live" ? (unwell === 0 ? "good" : "warn") : state === "connecting" ? "" : "bad";
  const touches = links.flatMap((link) =>
    (store.link(link.name).newest?.contacts ?? []).map((contact) => ({
      link: link.name,
      newtons: magnitudeN(contact),
    })),
  );
  const unknown = links.filter((link) => !store.link(link.name).newest?.totalForceN).length;
  const then = store.lookedAtS.value === undefined ? "" : `At ${clockTime(store.lookedAtS.value)}: `;
  return (
    <p class={`health ${kind}`} role="status">
      {then ? `Now ${text}` : text}
      {state === "live" && `. ${then}${touchSentence(touches, unknown)}`}
      {alarms > 0 && (
        <strong class="bad"> {alarms === 1 ? "1 link" : `${alarms} links`} above the alarm force</strong>
      )}
    </p>
  );
}

/** What is touched, in a sentence. `unknown`: links whose forces are not known. */
export function touchSentence(
  touches: readonly { link: string; newtons: number }[],
  unknown: number,
): string {
  const doubt =
    unknown === 0 ? "" : `; the forces of ${unknown === 1 ? "1 link" : `${unknown} links`} are not known`;
  if (touches.length === 0) return unknown === 0 ? "Nothing is touched" : `No touch is found${doubt}`;
  const strongest = touches.reduce((a, b) => (b.newtons > a.newtons ? b : a));
  const force = `${newtons(strongest.newtons)} on ${strongest.link}`;
  return (
    (touches.length === 1 ? `One touch, ${force}` : `${touches.length} touches, strongest ${force}`) + doubt
  );
}

function ThemeChoice() {
  const app = useApp();
  return (
    <label>
      <span class="hidden-text">Colours of the page</span>
      <select
        value={app.theme.value}
        onChange={(event) => (app.theme.value = event.currentTarget.value as Theme)}
      >
        <option value="system">Auto</option>
        <option value="dark">Dark</option>
        <option value="light">Light</option>
      </select>
    </label>
  );
}

function User() {
  const app = useApp();
  const open = useSignal(false);
  const caller = app.session.caller.value;
  const connection = app.feed.value.connection.value;
  const asked = connection.state === "signIn" ? connection.reason : "";
  useEffect(() => {
    if (asked) open.value = true;
  }, [asked]);
  const role = caller?.role === Role.OPERATOR ? "operator" : "viewer";
  return (
    <div class="user">
      {caller?.name && (
        <span>
          {caller.name}, {role}{" "}
          <button type="button" class="plain" onClick={() => app.session.signOut()}>
            Sign out
          </button>
        </span>
      )}
      {(caller?.tokens || asked) && !caller?.name && (
        <button type="button" onClick={() => (open.value = true)}>
          Sign in
        </button>
      )}
      {open.value && (
        <SignIn reason={asked || "Your token says who you are."} onClose={() => (open.value = false)} />
      )}
    </div>
  );
}
