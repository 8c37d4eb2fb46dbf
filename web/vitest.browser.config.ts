import { defineConfig } from "vitest/config";

// One server and one browser at a time: what they show must not depend on who else runs.
export default defineConfig({
  server: { host: "127.0.0.1" },
  test: {
    include: ["browser/**/*.test.ts"],
    fileParallelism: false,
    testTimeout: 60_000,
    hookTimeout: 120_000,
  },
});
