(() => {
  "use strict";
  const { charts, abscissae, light, dark } = JSON.parse(document.getElementById("charts").textContent);
  const darkPage = matchMedia("(prefers-color-scheme: dark)");
  const PAPER_PX = 680; // fits A4 and letter upright, with the browsers' own margins
  const config = {
    displaylogo: false,
    modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]], // named one by one: none may send data away
    plotlyServerURL: "",
    doubleClick: "reset+autosize",
  };

  // a name such as "@blue" becomes the colour it has on this page
  const dress = (chart, palette) =>
    JSON.parse(JSON.stringify(chart), (_, value) =>
      typeof value === "string" && value.startsWith("@") ? palette[value] : value);

  for (const chart of Object.values(charts)) {
    for (const trace of chart.data) trace.x = abscissae[trace.x];
  }

  const draw = (palette, width) =>
    Promise.all(Object.entries(charts).map(([name, chart]) => {
      const place = document.getElementById(`chart-${name}`);
      const { data, layout } = dress(chart, palette);
      layout.uirevision = "kept"; // a zoom outlives a change of colours
      if (matchMedia("(pointer: coarse)").matches) layout.dragmode = false; // a finger scrolls the page
      if (width) layout.width = width;
      const narrow = place.clientWidth < 520;
      if (narrow) Object.assign(layout.margin, { l: 52, r: 6 });
      return Plotly.react(place, data, layout, { ...config, displayModeBar: narrow ? false : "hover" });
    }));

  const current = () => (darkPage.matches ? dark : light);
  darkPage.addEventListener("change", () => draw(current()));
  addEventListener("beforeprint", () => draw(light, PAPER_PX));
  addEventListener("afterprint", () => draw(current()));
  draw(current()).then(
    () => {
      const watch = new ResizeObserver((entries) => entries.forEach(({ target }) => Plotly.Plots.resize(target)));
      for (const name of Object.keys(charts)) watch.observe(document.getElementById(`chart-${name}`));
      document.documentElement.dataset.charts = "drawn";
    },
    (error) => { document.documentElement.dataset.charts = `failed: ${error}`; },
  );
})();
