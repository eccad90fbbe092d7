// Draws a scene with three.js or filament.js in headless Chromium on llvmpipe: pictures in linear light, and processor time of frames.
// Usage: node browser.mjs MODULES JOB.json CHROMIUM LIBRARY, where MODULES is a node_modules folder, and LIBRARY three or filament:
// the package, and the start of its page's name. Reads a command a line from stdin and answers each with a line of JSON:
//   load KEY SAMPLES SHADOWS   the driver's name and the library's version
//   time KEY FRAMES            seconds of all processors together, in Chromium and all its processes
//   picture KEY FILE           writes linear radiance: RGBA halves, rows from below
import { createServer } from "node:http";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join, normalize, resolve } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath, pathToFileURL } from "node:url";

const [modules, jobFile, chromium, library] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
// SwiftShader is what Chromium falls back to without a word; these flags and variables lead to Mesa's llvmpipe.
const FLAGS = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm" };

/** The file that an address of the page stands for. */
function fileOf(path) {
    if (path === "/") return join(here, "page.html");
    if (path === "/page.js") return join(here, `${library}_page.js`);
    if (path === "/scene.js") return join(here, "scene.js");
    if (path === "/job") return jobFile;
    if (path.startsWith("/modules/")) return join(modules, normalize(path.slice(9)));
    // Those of the job: nobody else can reach this port.
    return path.startsWith("/file/") ? path.slice(5) : null;
}

function serve(request, response) {
    const file = fileOf(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
    try {
        const content = readFileSync(file);
        const type = TYPES[file.slice(file.lastIndexOf("."))] ?? "application/octet-stream";
        response.writeHead(200, { "Content-Type": type }).end(content);
    } catch {
        response.writeHead(404).end();
    }
}

/** Clock ticks, a hundredth of a second on Linux, that a process and all its descendants have taken: proc(5). */
function ticksOf(root) {
    const own = new Map();
    const children = new Map();
    for (const id of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
        try {
            const text = readFileSync(`/proc/${id}/stat`, "latin1");
            // After the name, which is in brackets and may hold anything, comes field 3.
            const fields = text.slice(text.lastIndexOf(")") + 2).split(" ");
            own.set(id, Number(fields[11]) + Number(fields[12]));
            children.set(fields[1], [...(children.get(fields[1]) ?? []), id]);
        } catch {
            // It has ended meanwhile.
        }
    }
    const sum = (id) => (own.get(id) ?? 0) + (children.get(id) ?? []).reduce((total, child) => total + sum(child), 0);
    return sum(String(root));
}

const puppeteer = createRequire(pathToFileURL(join(resolve(modules), "x.js")))("puppeteer-core");
const server = createServer(serve);
await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
const environment = { ...process.env, EGL_PLATFORM: "surfaceless", LIBGL_ALWAYS_SOFTWARE: "1" };
const browser = await puppeteer.launch({ executablePath: chromium, args: FLAGS, env: environment, protocolTimeout: 600_000 });
const page = await browser.newPage();
page.on("pageerror", (error) => console.error(String(error)));
await page.goto(`http://127.0.0.1:${server.address().port}/`);
await page.waitForFunction("window.load !== undefined");
const { version } = JSON.parse(readFileSync(join(modules, library, "package.json")));

const commands = {
    async load(key, samples, shadows) {
        const driver = await page.evaluate((...all) => window.load(...all), key, Number(samples), shadows === "shadows");
        if (!driver.includes("llvmpipe")) throw new Error(`drawn by ${driver}, not by llvmpipe`);
        return { driver, version, browser: await browser.version() };
    },
    async time(key, frames) {
        const before = ticksOf(browser.process().pid);
        await page.evaluate((...all) => window.draw(...all), key, Number(frames));
        return { seconds: (ticksOf(browser.process().pid) - before) / 100 };
    },
    async picture(key, file) {
        writeFileSync(file, Buffer.from(await page.evaluate((which) => window.picture(which), key), "base64"));
        return {};
    },
};

for await (const line of createInterface({ input: process.stdin })) {
    const [command, ...rest] = line.split(" ");
    try {
        console.log(JSON.stringify(await commands[command](...rest)));
    } catch (error) {
        console.log(JSON.stringify({ error: String(error.message ?? error).split("\n")[0] }));
    }
}
await browser.close();
server.close();
