// The parts of the page that are words.

const MARKS = { ok: "●", warning: "▲", error: "■", silent: "○" };

function element(tag, text, className = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  made.className = className;
  return made;
}

export function drawStatus(status) {
  const place = document.getElementById("status");
  const message = document.getElementById("message");
  const [text, kind] = describe(status);
  place.textContent = text;
  place.className = kind;
  place.style.setProperty("--progress", status.moving ? status.progress : 0);
  if (message && !status.lost) {
    message.textContent = status.message;
    message.className = status.failed ? "failed" : "";
  }
}

function describe(status) {
  if (status.lost) return ["console lost, connecting again", "lost"];
  if (status.moving) {
    const share = Math.round(100 * status.progress);
    return [`moving: ${status.phase} ${share} %${status.pausing ? ", then pause" : ""}`, "moving"];
  }
  if (status.planning) return ["planning", "busy"];
  return status.doing ? [status.doing, "busy"] : ["ready", "ready"];
}

export function drawNodes(nodes) {
  const list = element("ul", "", "nodes");
  for (const { node, level, text } of nodes) {
    const row = element("li", "", level);
    row.append(element("span", MARKS[level], "mark"), element("b", node.replace("_", " ")));
    row.append(element("span", text));
    list.append(row);
  }
  document.getElementById("nodes").replaceChildren(list);
  const bad = nodes.filter(({ level }) => level === "silent" || level === "error").length;
  const tab = document.querySelector('[data-tab="nodes"]');
  tab.textContent = bad ? `Nodes (${bad} ■)` : "Nodes";
  tab.classList.toggle("alarm", bad > 0);
}

export function drawFolds({ count, an_hour: rate, rows }) {
  const place = document.getElementById("folds");
  if (!count) return place.replaceChildren(element("p", "No manipulation yet.", "hint"));
  const table = document.createElement("table");
  table.append(line("th", ["#", "how", "goal", "MSE before", "after", "seconds"]));
  const shown = (value) => (value === null ? "–" : value.toFixed(4));
  for (const row of [...rows].reverse()) {
    const { example, kind, goal, before, after, seconds } = row;
    table.append(line("td", [example, kind, goal || "–", shown(before), shown(after), seconds]));
  }
  place.replaceChildren(element("p", `${count} done, ${rate} an hour`, "hint"), table);
}

function line(tag, values) {
  const row = document.createElement("tr");
  row.append(...values.map((value) => element(tag, String(value))));
  return row;
}

export function bindTabs(onShown) {
  const tabs = [...document.querySelectorAll("[data-tab]")];
  const show = (name) => {
    for (const tab of tabs) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
    for (const panel of document.querySelectorAll("[data-panel]")) {
      panel.classList.toggle("shown", panel.dataset.panel === name);
    }
    window.dispatchEvent(new Event("resize"));
    onShown();
  };
  for (const tab of tabs) tab.onclick = () => show(tab.dataset.tab);
  show("robot");
}
