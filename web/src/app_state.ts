import { effect, signal, type Signal } from "@preact/signals";
import { createContext } from "preact";
import { useContext } from "preact/hooks";
import { Session } from "./api/session";
import { formatAddress, parseAddress } from "./model/address";
import { ArmStore } from "./model/arm_store";
import type { Feed } from "./model/feed";
import { LiveFeed } from "./model/live_feed";
import { PastImages } from "./model/past";
import { Poker } from "./model/poker";
import { ReplayFeed } from "./model/replay_feed";
import { COLOUR_MAPS, type ColourMapName } from "./skin/colour_map";
import type { Quantity } from "./skin/fields";

export type Theme = "system" | "dark" | "light";

const prefersLight = matchMedia("(prefers-color-scheme: light)");

/** All that the views share. */
export class AppState {
  readonly session = new Session();
  /** The finger of this page on simulated links. */
  readonly poker = new Poker(this.session, (text) => this.tell(text, true));
  /** Of the live arm; of a log while one is played. */
  readonly store: Signal<ArmStore>;
  readonly feed: Signal<Feed>;
  readonly pastImages = new PastImages();

  readonly page = signal<"live" | "logs">("live");
  readonly link = signal("");
  readonly log = signal("");
  readonly quantity = signal<Quantity>("pressure");
  readonly colourMap = signal<ColourMapName>("skin");
  /** How many times as deep as they are dents are drawn. */
  readonly depthScale = signal(1);
  readonly theme = signal<Theme>("system");
  /** For people, at the foot of the page for a while. */
  readonly notice = signal<{ text: string; bad: boolean } | undefined>(undefined);

  private readonly systemLight = signal(prefersLight.matches);
  private noticeTimer: ReturnType<typeof setTimeout> | undefined;

  constructor() {
    const address = parseAddress(location.search);
    this.page.value = address.page;
    this.link.value = address.link;
    this.log.value = address.log;
    this.loadChoices();
    const [store, feed] = this.open(address.log, address.timeS);
    this.store = signal(store);
    this.feed = signal(feed);
    effect(() => this.keepChoices());
    effect(() => {
      const page = this.page.value;
      const link = this.link.value;
      const log = this.log.value;
      if (!log) this.showAddress({ page, link, log, timeS: NaN });
    });
    effect(() => {
      if (this.page.value !== "live") this.store.peek().lookAt(undefined);
    });
    effect(() => {
      this.session.generation.value;
      const running = this.feed.value;
      running.start();
      return () => running.stop();
    });
    prefersLight.addEventListener("change", () => (this.systemLight.value = prefersLight.matches));
    document.addEventListener("visibilitychange", () => this.feed.value.setHidden(document.hidden));
    addEventListener("popstate", () => location.reload());
  }

  /** Plays a log from a time on (s since 1970-01-01 UTC); empty: the live arm. */
  play(log: string, timeS = NaN): void {
    const [store, feed] = this.open(log, timeS);
    this.log.value = log;
    this.page.value = "live";
    this.store.value = store;
    this.feed.value = feed;
  }

  /** Shows the arm as it was at a time, s since 1970-01-01 UTC; undefined: as it is now, or goes on with the log. */
  seek(timeS: number | undefined): void {
    const feed = this.feed.value;
    if (!(feed instanceof ReplayFeed)) this.store.value.lookAt(timeS);
    else if (timeS !== undefined) void feed.seek(timeS);
  }

  /** The moment that is shown, s since 1970-01-01 UTC; undefined: now. */
  shownS(): number | undefined {
    const feed = this.feed.value;
    if (!(feed instanceof ReplayFeed)) return this.store.value.lookedAtS.value;
    return Number.isFinite(feed.positionS.value) ? feed.positionS.value : undefined;
  }

  tell(text: string, bad = false): void {
    clearTimeout(this.noticeTimer);
    this.notice.value = { text, bad };
    this.noticeTimer = setTimeout(() => (this.notice.value = undefined), bad ? 15_000 : 5_000);
  }

  showAddress(address: Parameters<typeof formatAddress>[0]): void {
    const text = formatAddress(address);
    if (text === location.search) return;
    try {
      history.replaceState(null, "", text || location.pathname);
    } catch {
      // Refused where it changes too often; the next change tells the place as well.
    }
  }

  private open(log: string, timeS: number): [ArmStore, Feed] {
    const store = new ArmStore(!log);
    if (!log) return [store, new LiveFeed(this.session, store)];
    const told = (atS: number) =>
      this.showAddress({ page: this.page.value, link: this.link.value, log, timeS: atS });
    return [store, new ReplayFeed(this.session, store, log, timeS, told)];
  }

  private loadChoices(): void {
    try {
      const kept = JSON.parse(localStorage.getItem("taclink.view") ?? "{}");
      if (kept.quantity === "displacement") this.quantity.value = "displacement";
      if (COLOUR_MAPS.includes(kept.colourMap)) this.colourMap.value = kept.colourMap;
      if (kept.theme === "dark" || kept.theme === "light") this.theme.value = kept.theme;
    } catch {
      localStorage.removeItem("taclink.view");
    }
  }

  private keepChoices(): void {
    const theme = this.theme.value;
    const text = JSON.stringify({ quantity: this.quantity.value, colourMap: this.colourMap.value, theme });
    localStorage.setItem("taclink.view", text);
    const system = this.systemLight.value ? "light" : "dark";
    document.documentElement.dataset.theme = theme === "system" ? system : theme;
  }
}

export const AppContext = createContext<AppState | undefined>(undefined);

export function useApp(): AppState {
  return useContext(AppContext)!;
}

/** The selected link; while nobody has selected one, that which was touched last, or the first one. */
export function selectedLink(app: AppState): string {
  const links = app.store.value.arm.value?.links ?? [];
  const wanted = app.link.value || app.store.value.touchedLink.value;
  return links.some((link) => link.name === wanted) ? wanted : (links[0]?.name ?? "");
}
