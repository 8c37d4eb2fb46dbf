import axe from "axe-core";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, onTestFinished, test } from "vitest";
import { boxOf, launch, Visit } from "./page";
import { configuration, pressed, Server, taclink, untouched } from "./server";

// In inferno no load is black, a fifth of the scale and more is purple to red; arrows are orange.
const isLoaded = (r: number, g: number, b: number) => r > g + 50 && b > 50;

let browser: Browser;
const server = new Server();

beforeAll(async () => {
  const still = server.write("still.yaml", untouched());
  const held = server.write("held.yaml", pressed(7, 5, 0.4));
  const config = server.write("arm.yaml", configuration("bench", { still, touched: held, third: still }));
  await server.start("--config", config);
  browser = await launch();
});
afterAll(async () => {
  await browser?.close();
  await server.close();
});

async function violations(visit: Visit): Promise<string[]> {
  await visit.page.evaluate(axe.source);
  const found = await visit.page.evaluate(async () => {
    const { violations: all } = await (globalThis as unknown as { axe: typeof axe }).axe.run();
    return all.map((each) => `${each.id}: ${each.nodes.map((node) => node.target.join(" ")).join(", ")}`);
  });
  return found;
}

describe("the arm", () => {
  test("is there with its links, forces and their colours", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`);
    const { page } = visit;
    await visit.row("touched").getByText("OK").waitFor();
    await visit.row("still").getByText("OK").waitFor();
    expect(await page.locator("tbody tr[data-link]").count()).toBe(3);
    await page.locator(".label.force", { hasText: "N" }).first().waitFor();
    const force = visit.row("touched").locator("td").nth(1);
    const forceN = async () => Number.parseFloat(await force.innerText());
    await expect.poll(forceN, { timeout: 10_000 }).toBeGreaterThan(0.36); // 0.4 N press
    expect(await forceN()).toBeLessThan(0.44);
    await visit.drawn();
    await visit.picture("whole");
    await page.getByRole("button", { name: /^Focus/ }).click();
    await visit.drawn();
    await visit.picture("live");
    await page.locator(".legend select").nth(2).selectOption("inferno");
    await visit.drawn();
    const touched = await visit.shareOfPixels(isLoaded);
    await visit.row("still").click();
    await page.getByRole("button", { name: /^Focus/ }).click();
    await visit.drawn();
    const still = await visit.shareOfPixels(isLoaded);
    expect(touched).toBeGreaterThan(0.0002);
    expect(still).toBeLessThan(touched / 10);
    await visit.close();
  });

  test("a link's address selects it", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=third`);
    await visit.row("third").waitFor();
    await expect.poll(() => visit.row("third").getAttribute("class")).toBe("selected");
    await visit.row("touched").click();
    await expect.poll(() => new URL(visit.page.url()).search).toBe("?link=touched");
    await visit.close();
  });

  test("the map tells values under the pointer and by keys", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`);
    const map = visit.page.locator(".map canvas");
    const readout = visit.page.locator(".readout");
    await visit.page.locator(".label.force").first().waitFor();
    const box = await boxOf(map);
    await visit.page.mouse.move(box.x + (6.5 / 24) * box.width, box.y + (1 - 4.5 / 10) * box.height);
    await expect.poll(() => readout.innerText()).toMatch(/path 7, ring 5: [1-9]/);
    const pressure = Number(/: ([\d.]+) kPa/.exec(await readout.innerText())![1]);
    expect(pressure).toBeGreaterThan(1);
    await map.focus();
    await visit.page.keyboard.press("ArrowRight");
    await visit.page.keyboard.press("ArrowUp");
    await expect.poll(() => readout.innerText()).toContain("path 8, ring 6");
    await visit.picture("map");
    await visit.close();
  });

  test("the cameras show pictures with the markers found in them", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`);
    await visit.page.getByRole("tab", { name: "Cameras" }).click();
    const caption = visit.page.locator("figcaption").first();
    await expect.poll(() => caption.innerText(), { timeout: 15_000 }).toMatch(/top: [12]\d\d markers/);
    await visit.page.getByLabel("labels (path.ring)").check();
    await visit.page.waitForTimeout(800);
    await visit.picture("cameras");
    await visit.close();
  });

  test("is usable by keys alone", async () => {
    const visit = await Visit.open(browser, server.url);
    const { page } = visit;
    await visit.row("still").waitFor();
    await page.locator(".scene canvas").waitFor();
    await page.locator(".scene canvas").focus();
    const frames = () => page.locator(".scene canvas").getAttribute("data-frames").then(Number);
    for (const key of ["ArrowLeft", "ArrowUp", "+", "-", "Home"]) {
      const before = await frames();
      await page.keyboard.press(key);
      await expect.poll(frames).toBeGreaterThan(before);
    }
    await page.getByRole("tab", { name: "Map" }).focus();
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowRight");
    expect(await page.getByRole("tab", { name: "Settings" }).getAttribute("aria-selected")).toBe("true");
    await visit.close();
  });

  test.each(["dark", "light"] as const)("has no fault that axe finds, %s", async (colorScheme) => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`, { colorScheme });
    await visit.page.locator(".label.force").first().waitFor();
    expect(await violations(visit)).toEqual([]);
    for (const tab of ["Cameras", "Settings"]) {
      await visit.page.getByRole("tab", { name: tab }).click();
      await visit.page.waitForTimeout(700);
      expect(await violations(visit)).toEqual([]);
    }
    await visit.page.getByRole("button", { name: /Record/ }).click();
    expect(await violations(visit)).toEqual([]);
    await visit.picture(`settings-${colorScheme}`);
    await visit.close();
  });

  test("fits a phone", async () => {
    const visit = await Visit.open(browser, server.url, { viewport: { width: 390, height: 844 } });
    await visit.row("touched").waitFor();
    await visit.page.locator(".label.force").first().waitFor();
    const width = await visit.page.evaluate(() => document.documentElement.scrollWidth);
    expect(width).toBeLessThanOrEqual(390);
    await visit.picture("phone");
    expect(await violations(visit)).toEqual([]);
    await visit.close();
  });
});

describe("a link that measures nothing", () => {
  // Shares of the small map's pixels: hatched, and of a light skin.
  const shares = (visit: Visit, link: string) =>
    visit.page.locator(".small-map", { hasText: link }).evaluate((button) => {
      const { width, height, data } = (() => {
        const canvas = button.querySelector("canvas")!;
        return canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
      })();
      let [hatched, light] = [0, 0];
      for (let i = 0; i < data.length; i += 4) {
        if (data[i] > 60 && data[i] < 130 && data[i + 2] > data[i]) ++hatched;
        if (data[i] > 180 && data[i + 2] > 150) ++light;
      }
      return { hatched: hatched / (width * height), light: light / (width * height) };
    });

  test("is hatched with its reason, without numbers, and changes no other", async () => {
    const own = new Server();
    onTestFinished(() => own.close());
    const still = own.write("still.yaml", untouched());
    const held = own.write("held.yaml", pressed(7, 5, 0.4));
    await own.start("--config", own.write("arm.yaml", configuration("two", { touched: held, still })));
    const visit = await Visit.open(browser, `${own.url}?link=touched`);
    const { page } = visit;
    await page.locator(".lens", { hasText: /touched 0\.[34]\d N/ }).waitFor({ timeout: 30_000 });
    expect(await page.locator(".small-map").allInnerTexts()).toEqual([
      expect.stringContaining("touched"),
      expect.stringContaining("still"),
    ]);
    expect((await shares(visit, "touched")).hatched).toBeLessThan(0.05);
    const ticks = await page.locator(".legend .ticks").innerText();
    // Its rest shape can't be taken while something presses.
    taclink("restart", "--link", "touched", "--server", own.address);
    await visit.row("touched").getByText("calibrating").waitFor({ timeout: 20_000 });
    await page.locator(".readout", { hasText: /Nothing is measured now\. .+/ }).waitFor({ timeout: 20_000 });
    await expect.poll(async () => (await shares(visit, "touched")).hatched).toBeGreaterThan(0.9);
    expect((await shares(visit, "still")).light).toBeGreaterThan(0.9);
    expect(await page.locator(".legend .ticks").innerText()).toBe(ticks);
    expect(await visit.row("touched").locator("td").nth(1).innerText()).toBe("–");
    expect(await page.locator(".lens").count()).toBe(0);
    await page
      .locator(".health", { hasText: "No touch is found; the forces of 1 link are not known" })
      .waitFor();
    await visit.picture("hatched");
    await visit.close();
  });
});

describe("the forces' curves", () => {
  test("stand still while paused, and the stream goes on", async () => {
    const visit = await Visit.open(browser, server.url);
    const { page } = visit;
    await page.locator(".u-over").waitFor();
    await page.getByRole("button", { name: "Pause" }).click();
    await page.waitForTimeout(400);
    const chart = page.locator(".chart canvas");
    const picture = () => chart.evaluate((canvas: HTMLCanvasElement) => canvas.toDataURL());
    const before = await picture();
    const frames = () => page.locator(".scene canvas").getAttribute("data-frames").then(Number);
    const drawn = await frames();
    await expect.poll(frames).toBeGreaterThan(drawn + 1);
    expect(await picture()).toBe(before);
    await page.getByRole("button", { name: "Go on" }).click();
    await expect.poll(picture).not.toBe(before);
    await visit.close();
  });

  test("begin with what the server remembers", async () => {
    const visit = await Visit.open(browser, server.url);
    const { page } = visit;
    await page.getByRole("button", { name: "10 s" }).click();
    // The curve of "touched", the second link's color, held at 0.4 N for long before the page was opened.
    const columns = () =>
      page.locator(".chart canvas").evaluate((canvas: HTMLCanvasElement) => {
        const { width, height } = canvas;
        const { data } = canvas.getContext("2d")!.getImageData(0, 0, width, height);
        const found = new Set<number>();
        for (let i = 0; i < data.length; i += 4)
          if (data[i] > 200 && data[i + 1] > 120 && data[i + 1] < 190 && data[i + 2] < 60)
            found.add((i / 4) % width);
        return found.size / width;
      });
    await expect.poll(columns, { timeout: 5000 }).toBeGreaterThan(0.7);
    await expect.poll(() => page.locator(".u-legend").innerText()).toMatch(/touched:?\s*0\.[34]\d N/);
    await visit.close();
  });

  test("can be those of each contact", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`);
    await visit.page.locator(".label.force").first().waitFor();
    await visit.page.getByRole("button", { name: "Contacts of touched" }).click();
    await expect.poll(() => visit.page.locator(".u-legend").innerText()).toMatch(/#\d+/);
    await visit.close();
  });
});

describe("the time line", () => {
  test("shows a moment before in rows, map, arm and pictures, and goes back to now", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=still`);
    const { page } = visit;
    await visit.row("still").getByText("OK").waitFor();
    await page.getByRole("tab", { name: "Cameras" }).click();
    await page.getByRole("img", { name: "top camera of still" }).waitFor();
    const forceN = async () => Number.parseFloat(await visit.row("still").locator("td").nth(1).innerText());
    const place = ["--link", "still", "--angle", "0", "--z", "90", "--server", server.address];
    taclink("poke", ...place, "--depth", "14", "--hold", "2");
    await expect.poll(forceN, { timeout: 20_000 }).toBeLessThan(0.02);
    const pictured = page.locator(".cameras .numbers").first();
    const takenNow = await pictured.innerText();
    // Back to when it was pressed: pictures, numbers and arrow are of then, and stay.
    const track = page.locator(".track");
    await track.focus();
    const shown = () => track.getAttribute("aria-valuetext");
    for (let second = 0; second < 20 && (await forceN()) < 0.05; ++second) {
      const before = await shown();
      await page.keyboard.press("ArrowLeft");
      await expect.poll(shown).not.toBe(before);
    }
    const thenN = await forceN();
    expect(thenN).toBeGreaterThan(0.05);
    await page.getByRole("button", { name: "Back to now" }).waitFor();
    await page.locator(".health", { hasText: /At .*touch/ }).waitFor();
    await page.locator(".label.force", { hasText: `${thenN.toFixed(2)} N` }).waitFor();
    expect(await pictured.innerText()).not.toBe(takenNow);
    expect(await page.locator(".poke").count()).toBe(0);
    await visit.picture("past");
    const frames = () => page.locator(".scene canvas").getAttribute("data-frames").then(Number);
    const drawn = await frames();
    await page.keyboard.press("Tab");
    expect(await forceN()).toBe(thenN);
    expect(await frames()).toBeGreaterThanOrEqual(drawn);
    await page.keyboard.press("Escape");
    await expect.poll(forceN).toBeLessThan(0.02);
    await page.getByText("● LIVE").waitFor();
    await visit.close();
  });

  test("a click on the curves shows that moment", async () => {
    const visit = await Visit.open(browser, `${server.url}?link=touched`);
    const { page } = visit;
    await page.locator(".label.force").first().waitFor();
    await page.locator(".replay", { hasText: /last ([3-9]|\d\d)/ }).waitFor();
    await page.getByRole("button", { name: "10 s" }).click();
    const curves = page.locator(".u-over");
    const box = await boxOf(curves);
    await page.mouse.click(box.x + 0.85 * box.width, box.y + box.height / 2);
    await page.getByRole("button", { name: "Back to now" }).waitFor();
    await page.locator(".replay", { hasText: /\d s ago/ }).waitFor();
    await page.getByRole("button", { name: "Back to now" }).click();
    await page.getByText("● LIVE").waitFor();
    await visit.close();
  });
});

describe("a server that ends", () => {
  test("is seen to be gone, and taken up again when it is back", async () => {
    const own = new Server();
    onTestFinished(() => own.close());
    const config = own.write(
      "arm.yaml",
      configuration("away", { only: own.write("still.yaml", untouched()) }),
    );
    await own.start("--config", config);
    const visit = await Visit.open(browser, own.url);
    await visit.row("only").getByText("OK").waitFor();
    await own.kill();
    const banner = visit.page.getByRole("alert").filter({ hasText: "Connection lost" });
    await banner.waitFor({ timeout: 10_000 });
    await visit.picture("lost");
    await own.start("--config", config);
    await banner.waitFor({ state: "detached", timeout: 15_000 });
    await visit.row("only").getByText("OK").waitFor({ timeout: 15_000 });
    await visit.close();
  });
});
