// Charts that answer: each drawing of a chart is replaced by a live one when it comes near.
// Without this script, on paper, and if anything goes wrong, the drawings stay as they are.
(() => {
  const alive = new Map();
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) wake(entry.target);
  }, { rootMargin: "300px" });
  const charts = [...document.querySelectorAll(".chart")];
  const maps = [...document.querySelectorAll("[data-cell] svg[data-way]")];
  for (const chart of charts) near.observe(chart);

  // Tables stand in the page by columns, which are more compact than rows.
  const byRows = (key, value) => key !== "values" || Array.isArray(value) ? value
    : Object.values(value)[0].map((_, n) =>
      Object.fromEntries(Object.entries(value).map(([name, column]) => [name, column[n]])));

  // A live chart looks as its drawing does, which is stretched to its place. It is not stretched
  // itself, since pointers are measured in pixels of the page: all its lengths grow.
  const LENGTH = /(width|height|size|extent|limit|offset|padding|spacing|thickness)$/i;
  function fitted(chart) {
    const drawing = chart.querySelector("svg");
    const growth = drawing.getBoundingClientRect().width / drawing.viewBox.baseVal.width;
    const grown = (key, value) => LENGTH.test(key) && typeof value === "number" ? growth * value : byRows(key, value);
    const text = chart.querySelector("script").textContent;
    return [JSON.parse(text, grown), JSON.parse(JSON.stringify(chartTheme), grown)];
  }

  async function wake(chart) {
    near.unobserve(chart);
    const place = chart.appendChild(document.createElement("div"));
    place.className = "live";
    try {
      const [spec, config] = fitted(chart);
      const result = await vegaEmbed(place, spec, {
        mode: "vega-lite", renderer: "svg", actions: false, ast: true, config,
        tooltip: { theme: matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light" },
      });
      alive.set(chart, result);
      chart.classList.add("alive");
      listen(chart, result.view);
    } catch (problem) {
      place.remove();
      console.warn(problem);
    }
  }

  function sleep(chart) {
    alive.get(chart)?.finalize();
    alive.delete(chart);
    chart.classList.remove("alive");
    chart.querySelector(".live")?.remove();
    near.observe(chart);
  }

  // What is brushed or pointed at in a chart is shown by all charts and maps of the same cell.
  function listen(chart, view) {
    const of = (item) => chart.dataset.cell && item.closest("[data-cell]").dataset.cell === chart.dataset.cell;
    const signals = view.getState({ signals: (name) => name === "brush" || name === "near" }).signals;
    if ("brush" in signals) view.addSignalListener("brush", (_, brush) => {
      const span = brush.time ?? [0, 0];
      for (const [other, { view }] of alive)
        if (other !== chart && of(other)) view.signal("span", span).runAsync();
      for (const map of maps) if (of(map)) drawPart(map, span);
    });
    if ("near" in signals) view.addSignalListener("near", (_, at) => {
      for (const map of maps) if (of(map)) drawDot(map, at.repeat?.[0], at.time?.[0]);
    });
  }

  function overlay(map, name, look) {
    const element = map.querySelector(`.${name}`)
      ?? map.appendChild(document.createElementNS("http://www.w3.org/2000/svg", look));
    element.setAttribute("class", name);
    return element;
  }

  // Read once: the pointer asks for a place many times a second.
  const ways = new Map();
  function waysOf(map) {
    if (!ways.has(map)) ways.set(map, JSON.parse(map.dataset.way));
    return ways.get(map);
  }

  function drawPart(map, [from, to]) {
    const parts = waysOf(map).map((way) => {
      const points = way.t.flatMap((time, n) => time >= from && time <= to ? [`${way.x[n]} ${way.y[n]}`] : []);
      return points.length > 1 ? `M${points.join(" ")}` : "";
    });
    overlay(map, "brushed", "path").setAttribute("d", parts.join(""));
  }

  function drawDot(map, repeat, time) {
    const way = waysOf(map).find((one) => one.repeat === repeat);
    const dot = overlay(map, "pointed", "circle");
    dot.setAttribute("r", way ? 6 : 0);
    if (!way) return;
    const later = way.t.findIndex((one) => one >= time);
    const n = later < 0 ? way.t.length - 1 : later;
    dot.setAttribute("cx", way.x[n]);
    dot.setAttribute("cy", way.y[n]);
  }

  // Another width: begin again from the drawings.
  let waiting;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => [...alive.keys()].forEach(sleep), 200);
  });
})();
