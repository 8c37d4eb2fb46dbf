import { AppContext, useApp, type AppState } from "./app_state";
import { ConnectionBanner } from "./views/connection_banner";
import { EventList } from "./views/event_list";
import { Header } from "./views/header";
import { LinkPanel } from "./views/link_panel";
import { LinkTable } from "./views/link_table";
import { LogsPage } from "./views/logs_page";
import { SceneView } from "./views/scene_view";
import { TimeBar } from "./views/time_bar";
import { TimeView } from "./views/time_view";

export function App({ state }: { state: AppState }) {
  return (
    <AppContext.Provider value={state}>
      <Page />
    </AppContext.Provider>
  );
}

function Page() {
  const app = useApp();
  const { state } = app.feed.value.connection.value;
  const old = state === "lost" || state === "signIn";
  return (
    <>
      <button type="button" class="skip" onClick={() => document.querySelector("main")?.focus()}>
        To the content
      </button>
      <Header />
      <ConnectionBanner />
      {(app.page.value === "live" || app.log.value) && <TimeBar />}
      {app.page.value === "logs" ? (
        <LogsPage />
      ) : (
        <main tabIndex={-1} class={old ? "arm old" : "arm"}>
          <SceneView />
          <LinkPanel />
          <LinkTable />
          <TimeView />
          <EventList />
        </main>
      )}
      <Notice />
    </>
  );
}

function Notice() {
  const app = useApp();
  const notice = app.notice.value;
  return (
    <div class="notices" role={notice?.bad ? "alert" : "status"}>
      {notice && (
        <p class={notice.bad ? "notice bad" : "notice"}>
          {notice.text}{" "}
          <button
            type="button"
            class="plain"
            aria-label="Dismiss"
            onClick={() => (app.notice.value = undefined)}
          >
            ✕
          </button>
        </p>
      )}
    </div>
  );
}
