import { defineConfig } from "vite";

// Everything is served from /page by the service itself, under `default-src 'self'`: nothing inline, nothing from outside.
export default defineConfig({
  base: "/page/",
  build: {
    emptyOutDir: true,
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
    sourcemap: false,
    chunkSizeWarningLimit: 400,
  },
});
