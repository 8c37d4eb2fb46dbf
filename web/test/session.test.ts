import { expect, it } from "vitest";
import { callBase } from "../src/api/session";

it("calls the server where the page came from", () => {
  expect(callBase("http://127.0.0.1:8080/?link=upper#x")).toBe("http://127.0.0.1:8080/");
  expect(callBase("http://127.0.0.1:8080/index.html")).toBe("http://127.0.0.1:8080/");
  expect(callBase("https://site.example/robots/left/?link=upper")).toBe("https://site.example/robots/left/");
});
