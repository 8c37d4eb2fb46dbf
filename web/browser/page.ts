import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium, type Browser, type Locator, type Page } from "playwright-core";

const PICTURES =
  process.env.TACLINK_PICTURES ?? fileURLToPath(new URL("../../build/web-pictures", import.meta.url));

const SETTLE_MS = 20_000;
const STILL_MS = 700;

export function launch(): Promise<Browser> {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--disable-dev-shm-usage",
    ],
  });
}

/** What the card of a pressed skin says. */
export interface Felt {
  feltN: number;
  trueN: number;
  offMm: number;
}

/** A page of the server's; whatever it asks elsewhere, or complains of, fails the test at `close`. */
export class Visit {
  readonly troubles: string[] = [];

  private constructor(readonly page: Page) {}

  static async open(
    browser: Browser,
    url: string,
    options: Parameters<Browser["newPage"]>[0] = {},
  ): Promise<Visit> {
    const page = await browser.newPage({
      viewport: { width: 1440, height: 900 },
      colorScheme: "dark",
      ...options,
    });
    const visit = new Visit(page);
    const origin = new URL(url).origin;
    page.on("request", (request) => {
      const address = new URL(request.url());
      if (address.origin !== origin && !["data:", "blob:"].includes(address.protocol))
        visit.troubles.push(`a request left for ${request.url()}`);
    });
    page.on("pageerror", (error) => visit.troubles.push(`error in the page: ${error.message}`));
    await page.goto(url);
    return visit;
  }

  async close(): Promise<void> {
    await this.page.close();
    if (this.troubles.length > 0) throw new Error(this.troubles.join("\n"));
  }

  picture(name: string): Promise<Buffer> {
    mkdirSync(PICTURES, { recursive: true });
    return this.page.screenshot({ path: join(PICTURES, `${name}.png`) });
  }

  /** Until the scene was drawn twice from now on: what was asked of it before is on the canvas. */
  async drawn(): Promise<void> {
    const canvas = this.page.locator(".scene canvas");
    const before = Number(await canvas.getAttribute("data-frames"));
    await this.page.waitForFunction(
      (least) => Number(document.querySelector<HTMLElement>(".scene canvas")?.dataset.frames) >= least,
      before + 2,
    );
  }

  async felt(): Promise<Felt | undefined> {
    const text = (await this.page.locator(".felt").allInnerTexts()).join(" ");
    const found = /: ([\d.]+) N, true ([\d.]+) N; ([\d.]+) mm off/.exec(text);
    return found ? { feltN: +found[1], trueN: +found[2], offMm: +found[3] } : undefined;
  }

  /** Once the body has arrived: what is true does not change any more. */
  async settledFelt(): Promise<Felt> {
    const deadline = performance.now() + SETTLE_MS;
    for (let last = -1; performance.now() < deadline; await this.page.waitForTimeout(STILL_MS)) {
      const felt = await this.felt();
      if (felt && felt.trueN === last) return felt;
      last = felt?.trueN ?? -1;
    }
    throw new Error("what is pressed does not settle");
  }

  row(link: string) {
    return this.page.locator(`tr[data-link="${link}"]`);
  }

  /** Share of the scene's pixels that `is` holds for; r, g, b: 0 to 255. Only the canvas counts, no text over it. */
  async shareOfPixels(is: (r: number, g: number, b: number) => boolean): Promise<number> {
    const style = await this.page.addStyleTag({
      content: ".labels, .legend, .poke, .tools { visibility: hidden !important; }",
    });
    const png = await this.page.locator(".scene canvas").screenshot();
    await style.evaluate((element) => (element as Element).remove());
    const source = `data:image/png;base64,${png.toString("base64")}`;
    return this.page.evaluate(
      async ([address, text]) => {
        const holds = new Function(`return (${text})`)() as (r: number, g: number, b: number) => boolean;
        const image = new Image();
        image.src = address;
        await image.decode();
        const canvas = document.createElement("canvas");
        canvas.width = image.width;
        canvas.height = image.height;
        const context = canvas.getContext("2d")!;
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, 0, image.width, image.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (holds(data[i], data[i + 1], data[i + 2])) ++count;
        return count / (data.length / 4);
      },
      [source, is.toString()] as const,
    );
  }
}

/** The box of an element in page coordinates; waits until it is laid out, because a component may just be drawn again. */
export async function boxOf(element: Locator, timeoutMs = 10_000) {
  const deadline = Date.now() + timeoutMs;
  for (;;) {
    const box = await element.boundingBox();
    if (box) return box;
    if (Date.now() > deadline) throw new Error(`${element} has no box after ${timeoutMs} ms`);
    await element.page().waitForTimeout(50);
  }
}
