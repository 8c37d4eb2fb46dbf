import { useSignal } from "@preact/signals";
import { selectedLink, useApp } from "../app_state";
import { CameraView } from "./camera_view";
import { LinkStrip } from "./link_strip";
import { SettingsView } from "./settings_view";
import { UnrolledMap } from "./unrolled_map";

const TABS = ["Map", "Cameras", "Settings"] as const;
type Tab = (typeof TABS)[number];

/** All about the selected link. */
export function LinkPanel() {
  const app = useApp();
  const tab = useSignal<Tab>("Map");
  const name = selectedLink(app);
  const links = app.store.value.arm.value?.links ?? [];
  const link = links.find((each) => each.name === name);

  // What somebody looks into stays, whatever is touched.
  const open = (chosen: Tab) => {
    tab.value = chosen;
    app.link.value = name;
  };
  const steer = (event: KeyboardEvent) => {
    const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (step === 0) return;
    open(TABS[(TABS.indexOf(tab.value) + step + TABS.length) % TABS.length]);
    document.getElementById(`tab-${tab.value}`)?.focus();
  };
  return (
    <section class="panel" aria-label="Selected link">
      <header>
        <label>
          <span class="hidden-text">Selected link</span>
          <select value={name} onChange={(event) => (app.link.value = event.currentTarget.value)}>
            {links.map((each) => (
              <option value={each.name}>{each.name}</option>
            ))}
          </select>
        </label>
        <div role="tablist" aria-label="About the link" onKeyDown={steer}>
          {TABS.map((each) => (
            <button
              type="button"
              role="tab"
              id={`tab-${each}`}
              aria-selected={tab.value === each}
              aria-controls="tab-content"
              tabIndex={tab.value === each ? 0 : -1}
              onClick={() => open(each)}
            >
              {each}
            </button>
          ))}
        </div>
      </header>
      <LinkStrip />
      <div
        id="tab-content"
        role="tabpanel"
        aria-labelledby={`tab-${tab.value}`}
        class="scroller"
        tabIndex={0}
      >
        {!link?.model?.markers && <p class="empty">No link is selected.</p>}
        {link?.model?.markers && tab.value === "Map" && <UnrolledMap key={link.name} link={link} />}
        {link?.model?.markers && tab.value === "Cameras" && <CameraView key={link.name} link={link} />}
        {link && tab.value === "Settings" && <SettingsView key={link.name} link={link} />}
      </div>
    </section>
  );
}
