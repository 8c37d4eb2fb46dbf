import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { launch, Visit } from "./page";
import { configuration, pressed, Server, taclink, untouched } from "./server";

let browser: Browser;
const server = new Server();
const tokens: Record<string, string> = {};

beforeAll(async () => {
  const lines = (["viewer", "operator"] as const).map((role) => {
    const name = role === "viewer" ? "vera" : "otto";
    const { line, token } = makeToken(name, role);
    tokens[name] = token;
    return line;
  });
  server.write("tokens", `${lines.join("\n")}\n`);
  const still = server.write("still.yaml", untouched());
  const held = server.write("held.yaml", pressed(7, 5, 0.4));
  const config = server.write(
    "arm.yaml",
    configuration("bench", { still, touched: held }, "security: {tokens: tokens}\n"),
  );
  await server.start("--config", config);
  browser = await launch();
});
afterAll(async () => {
  await browser?.close();
  await server.close();
});

function makeToken(name: string, role: string): { line: string; token: string } {
  const { stdout, stderr } = taclink("token", "new", name, "--role", role);
  return { line: stdout.trim(), token: stderr.trim().split(" ").pop()! };
}

async function signIn(visit: Visit, token: string): Promise<void> {
  await visit.page.getByLabel("Token").fill(token);
  await visit.page.locator("dialog").getByRole("button", { name: "Sign in" }).click();
}

async function enter(user: string, query = ""): Promise<Visit> {
  const visit = await Visit.open(browser, server.url + query);
  await signIn(visit, tokens[user]);
  await visit.row("touched").getByText("OK").waitFor();
  return visit;
}

describe("signing in", () => {
  test("is asked for, and a wrong token is refused", async () => {
    const visit = await Visit.open(browser, server.url);
    await visit.page.getByRole("dialog", { name: "Sign in" }).waitFor();
    await visit.picture("sign-in");
    await signIn(visit, "nonsense");
    await visit.page.getByText("does not know this token").waitFor();
    await signIn(visit, tokens.vera);
    await visit.row("still").waitFor();
    await visit.page.getByText("vera, viewer").waitFor();
    await visit.page.reload();
    await visit.row("still").waitFor();
    await visit.page.getByRole("button", { name: "Sign out" }).click();
    await visit.page.getByRole("dialog", { name: "Sign in" }).waitFor();
    await visit.close();
  });

  test("a viewer sees why buttons do nothing", async () => {
    const visit = await enter("vera", "?link=still");
    await visit.page.getByRole("tab", { name: "Settings" }).click();
    const tare = visit.page.getByRole("button", { name: "Tare …", exact: true });
    expect(await tare.getAttribute("aria-disabled")).toBe("true");
    expect(await tare.getAttribute("title")).toContain("sign in as an operator");
    await tare.click({ force: true });
    await visit.page.waitForTimeout(500);
    expect(await visit.page.locator(".events").innerText()).not.toContain("tare");
    await visit.picture("viewer");
    await visit.close();
  });
});

describe("an operator", () => {
  test("tares; a touched skin refuses and says why", async () => {
    const visit = await enter("otto", "?link=still");
    await visit.page.getByRole("tab", { name: "Settings" }).click();
    const dialog = visit.page.getByRole("dialog");
    const begin = visit.page.getByRole("button", { name: "Tare …", exact: true });
    await begin.click();
    await dialog.getByText("still: nothing touches it").waitFor();
    await dialog.getByRole("button", { name: "Tare", exact: true }).click();
    await dialog.getByText(/still is tared/).waitFor();
    await dialog.getByRole("button", { name: "Undo" }).click();
    await dialog.getByText("still: the tare is undone.").waitFor();
    await dialog.getByRole("button", { name: "Close" }).last().click();
    await visit.row("touched").click();
    await visit.page.locator(".label.force").first().waitFor();
    await begin.click();
    await dialog.getByText("touched: 1 contact").waitFor();
    await dialog.getByRole("button", { name: "Tare", exact: true }).click();
    await dialog.getByText(/^touched: .*touch/).waitFor();
    await dialog.getByRole("button", { name: "Tare anyway" }).waitFor();
    await visit.picture("tare-refused");
    await visit.close();
  });

  test("tares all links only when that was confirmed", async () => {
    const visit = await enter("otto", "?link=still");
    await visit.page.getByRole("button", { name: "Tare all links" }).click();
    const dialog = visit.page.getByRole("dialog", { name: "Tare all 2 links" });
    await dialog.getByText("touched: 1 contact").waitFor();
    await visit.page.keyboard.press("Escape");
    await dialog.waitFor({ state: "detached" });
    expect(await visit.page.locator(".events").innerText()).not.toContain("tare");
    await visit.page.getByRole("button", { name: "Tare all links" }).click();
    await dialog.getByRole("button", { name: "Tare all", exact: true }).click();
    await dialog.getByText(/still is tared/).waitFor();
    await dialog.getByText(/^touched: .*touch/).waitFor();
    await visit.picture("tare-all");
    await visit.close();
  });

  test("sets thresholds, and an alarm is seen", async () => {
    const visit = await enter("otto", "?link=touched");
    const { page } = visit;
    await page.getByRole("tab", { name: "Settings" }).click();
    const form = page.locator("fieldset", { hasText: "Thresholds, whole link" });
    await form.getByLabel("Warning").fill("0.1");
    await form.getByLabel("Alarm").fill("0.2");
    await form.getByRole("button", { name: "Set" }).click();
    await page.getByText(/Thresholds of touched, whole link, are set/).waitFor();
    await visit.row("touched").getByText("alarm").waitFor();
    await page.getByText("1 link above the alarm force").waitFor();
    await expect.poll(() => page.title()).toContain("(1)");
    expect(await page.locator("tbody tr").first().getAttribute("data-link")).toBe("touched");
    await page.waitForTimeout(1000);
    await visit.picture("alarm");
    await form.getByLabel("Alarm").fill("0.05");
    await form.getByRole("button", { name: "Set" }).click();
    await page.getByRole("alert").filter({ hasText: /alarm/ }).waitFor();
    await visit.close();
  });

  test("chooses the force model and the cameras' exposure", async () => {
    const visit = await enter("otto", "?link=still");
    const { page } = visit;
    await page.getByRole("tab", { name: "Settings" }).click();
    const model = page.locator("fieldset", { hasText: "Force model" });
    await model.getByLabel("Model").selectOption({ label: "nonlinear" });
    await model.getByRole("button", { name: "Use" }).click();
    await expect.poll(() => visit.row("still").innerText(), { timeout: 20_000 }).toContain("nonlinear");
    const camera = page.locator("fieldset", { hasText: "Cameras" });
    await camera.getByLabel("Exposure").fill("8");
    await camera.getByRole("button", { name: "Set" }).click();
    await page.getByText(/cameras of still are set/i).waitFor();
    await camera.getByLabel("Exposure").fill("900");
    await camera.getByRole("button", { name: "Set" }).click();
    await page.getByRole("alert").filter({ hasText: "0.1 to 100 ms" }).waitFor();
    await visit.close();
  });

  test("calibrates, with progress and a result", async () => {
    const visit = await enter("otto", "?link=still");
    const { page } = visit;
    await page.getByRole("tab", { name: "Settings" }).click();
    await page.getByRole("button", { name: /Calibrate/ }).click();
    await page.getByRole("button", { name: "Start", exact: true }).click();
    await page.getByText("Markers used").waitFor({ timeout: 30_000 });
    await visit.picture("calibrated");
    await page.getByRole("button", { name: "Close", exact: true }).last().click();
    await visit.row("still").getByText("OK").waitFor();
    await visit.close();
  });

  test("records, plays, steers and deletes a log", async () => {
    const visit = await enter("otto", "?link=touched");
    const { page } = visit;
    await page.getByRole("button", { name: /Record/ }).click();
    await page.getByLabel("Name").fill("browser");
    await page.getByLabel("Note").fill("a pinch");
    await page.getByLabel(/pictures/).check();
    await page.locator("dialog").getByRole("button", { name: "Record" }).click();
    await page.locator(".record-sign").waitFor();
    await page.waitForTimeout(4000);
    await page.getByRole("button", { name: "Stop" }).click();
    await page.getByText(/Recorded browser/).waitFor();

    await page.getByRole("navigation").getByRole("button", { name: "Logs" }).click();
    const row = page.locator("tr[data-log]");
    await row.getByText("a pinch").waitFor();
    await row.getByRole("img", { name: /^Force over time, at most 0\.[34]\d N/ }).waitFor();
    await row.getByText(/^0\.[34]\d N on touched/).waitFor();
    await visit.picture("logs");
    await page.getByRole("searchbox").fill("nothing like it");
    await page.getByText("No log holds these words").waitFor();
    await page.getByRole("searchbox").fill("pinch");
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      row.getByRole("button", { name: /^Download/ }).click(),
    ]);
    const copy = `${server.folder}/copy.mcap`;
    await download.saveAs(copy);
    taclink("log", "check", copy);

    await row.getByRole("button", { name: /^Play .*mcap$/ }).click();
    await page.locator(".replay").getByText("REPLAY").waitFor();
    await visit.row("touched").getByText("OK").waitFor();
    await page.getByRole("button", { name: "Pause", exact: true }).first().click();
    await page.getByRole("slider").focus();
    await page.keyboard.press("Home");
    await expect.poll(() => page.getByRole("slider").getAttribute("aria-valuenow")).toBe("0");
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowRight");
    await expect.poll(() => page.getByRole("slider").getAttribute("aria-valuenow")).toBe("2");
    await page.getByRole("button", { name: "Step" }).click();
    await page.locator(".label.force").first().waitFor();
    await page.locator(".track .span").first().waitFor(); // it was there before the recording began
    await visit.picture("replay");
    await page.getByRole("tab", { name: "Cameras" }).click();
    await page.getByRole("img", { name: "bottom camera of touched" }).waitFor();
    await page.getByText("Logs hold the markers' positions").waitFor();
    await visit.picture("replay-cameras");
    const shared = page.url();
    expect(new URL(shared).searchParams.get("t")).not.toBeNull();
    const tare = page.getByRole("tab", { name: "Settings" });
    await tare.click({ force: true });
    const title = await page.getByRole("button", { name: "Tare …" }).getAttribute("title");
    expect(title).toContain("live arm");
    await page.getByRole("button", { name: "Back to the live arm", exact: true }).click();
    await expect.poll(() => new URL(page.url()).searchParams.get("log")).toBeNull();

    await page.getByRole("navigation").getByRole("button", { name: "Logs" }).click();
    await row.getByRole("button", { name: /^Delete/ }).click();
    await page.getByRole("button", { name: "Delete", exact: true }).last().click();
    await page.getByText(/There are no logs yet/).waitFor();
    await visit.close();
  });
});
