import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { defineConfig } from "vitest/config";
import { licensesOf } from "./licenses.config";

// The server embeds the files by name, so that names are fixed; it tells browsers whether one has changed.
export default defineConfig({
  base: "./", // a proxy may serve the page below a path of its own
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  // By number: systems without a name for themselves have tests too.
  server: { host: "127.0.0.1", proxy: { "/taclink.v1": "http://127.0.0.1:8080" } },
  build: {
    target: "es2022",
    modulePreload: false,
    chunkSizeWarningLimit: 1000,
    rollupOptions: {
      output: {
        entryFileNames: "[name].js",
        chunkFileNames: "[name].js",
        assetFileNames: "[name][extname]",
      },
    },
  },
  plugins: [
    {
      name: "scene-at-once", // three.js is loaded beside the rest, not after it
      transformIndexHtml: (_, { bundle }) =>
        bundle
          ? [
              {
                tag: "link",
                attrs: { rel: "modulepreload", href: "./arm_scene.js" },
                injectTo: "head" as const,
              },
            ]
          : [],
    },
    {
      name: "licenses",
      generateBundle(_, bundle) {
        const modules = Object.values(bundle).flatMap((file) =>
          file.type === "chunk" ? Object.keys(file.modules) : [],
        );
        const apache = fileURLToPath(new URL("../LICENSE", import.meta.url));
        this.emitFile({ type: "asset", fileName: "licenses.txt", source: licensesOf(modules, apache) });
      },
    },
    {
      name: "compressed-copies",
      writeBundle({ dir }) {
        for (const name of readdirSync(dir!).filter((each) => !each.endsWith(".gz")))
          writeFileSync(join(dir!, `${name}.gz`), gzipSync(readFileSync(join(dir!, name)), { level: 9 }));
      },
    },
  ],
  test: { include: ["test/**/*.test.ts"] },
});
