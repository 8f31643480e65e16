// Draws the charts of a report, a function a kind, with D3 (5 and later). The page gives each its data, and beside it the table
// with the same rows: mark i is row i. Nothing is computed here but where things stand.
"use strict";

(function () {
  const kSymbols = [d3.symbolCircle, d3.symbolSquare, d3.symbolTriangle, d3.symbolDiamond, d3.symbolStar, d3.symbolCross, d3.symbolWye];
  const kColors = 8;
  const kNarrow = 560; // Below it, names stand above their rows.
  const kCharacter = 6.8; // Pixels of one, about, at 12 px.

  const color = (index) => `var(--s${index % kColors})`;
  const symbol = (index, size) => d3.symbol().type(kSymbols[index % kSymbols.length]).size(size || 64)();
  const measured = (mark) => !mark.provenance;
  const unique = (values) => Array.from(new Set(values));
  const short = (value) => {
    const size = Math.abs(value);
    return size !== 0 && (size >= 1e5 || size < 1e-4) ? value.toExponential(0) : String(Number(value.toPrecision(3)));
  };
  const known = (value) => value !== undefined && value !== null;

  // Axes.

  // A linear axis begins at 0, unless it is told that what counts is where points stand to one another.
  function extent(values, log, loose) {
    const usable = values.filter((value) => known(value) && (!log || value > 0));
    if (usable.length === 0) return log ? [1, 10] : [0, 1];
    const [low, high] = d3.extent(usable);
    if (log) return [low / 1.3, high * 1.3];
    const room = Math.max((high - low) * 0.12, Math.abs(high) * 0.05, 1e-9);
    return loose ? [Math.max(low - room, low >= 0 ? 0 : -Infinity), high + room] : [Math.min(0, low), high > 0 ? high * 1.05 : 1];
  }

  function scale(axis, domain, range) {
    return (axis.log ? d3.scaleLog() : d3.scaleLinear()).domain(domain).range(range);
  }

  // On a logarithmic axis the powers of ten, with 2 and 5 between them where there is room.
  function ticks(axis, position, room) {
    const count = Math.max(2, Math.floor(room / 70));
    if (!axis.log) return position.ticks(Math.min(count, 10));
    const [low, high] = position.domain();
    if (high / low < 8) return d3.ticks(low, high, count);
    const exponents = d3.range(Math.floor(Math.log10(low)), Math.ceil(Math.log10(high)) + 1);
    for (const digits of [[1, 2, 5], [1, 3], [1]]) {
      const values = [].concat(...exponents.map((e) => digits.map((d) => d * Math.pow(10, e))));
      const shown = values.filter((value) => value >= low && value <= high);
      if (shown.length <= count || digits.length === 1) {
        return shown.filter((_, i) => i % Math.ceil(shown.length / count) === 0);
      }
    }
    return [];
  }

  function bottomAxis(box, axis, position) {
    const values = ticks(axis, position, box.right - box.left);
    const at = (y) => box.svg.append("g").attr("transform", `translate(0,${y})`);
    at(box.bottom).attr("class", "grid").call(d3.axisBottom(position).tickValues(values).tickFormat("").tickSize(box.top - box.bottom));
    at(box.bottom).call(d3.axisBottom(position).tickValues(values).tickFormat(short));
    if (box.bottom - box.top > 500) at(box.top).call(d3.axisTop(position).tickValues(values).tickFormat(short));
    box.svg.append("text").attr("class", "soft").attr("x", box.right).attr("y", box.bottom + 34).attr("text-anchor", "end")
      .text(axis.label);
  }

  function leftAxis(box, axis, position) {
    const values = ticks(axis, position, (box.bottom - box.top) * 1.5);
    const at = () => box.svg.append("g").attr("transform", `translate(${box.left},0)`);
    at().attr("class", "grid").call(d3.axisLeft(position).tickValues(values).tickFormat("").tickSize(box.left - box.right));
    at().call(d3.axisLeft(position).tickValues(values).tickFormat(short));
    box.svg.append("text").attr("class", "soft").attr("x", 0).attr("y", box.top - 8).text(axis.label);
  }

  // The drawing of a figure: an SVG as wide as the page lets it be.
  function canvas(plot, height, margin) {
    const width = Math.max(280, plot.node().clientWidth);
    const svg = plot.append("svg").attr("viewBox", `0 0 ${width} ${height}`).attr("role", "group");
    return {
      svg: svg, width: width, left: margin.left, right: width - margin.right, top: margin.top, bottom: height - margin.bottom,
    };
  }

  // Where the rows of a chart stand, with their names beside them or, on a narrow page, above them.
  function layRows(plot, names, row) {
    const width = Math.max(280, plot.node().clientWidth);
    const longest = d3.max(names, (name) => name.length) * kCharacter + 20;
    const above = width < kNarrow || longest > width / 3;
    const step = row + (above ? 16 : 4);
    const tall = step * names.length > 500; // With an axis above too.
    const margin = {left: above ? 8 : longest, right: 14, top: tall ? 26 : 6, bottom: 42};
    const box = canvas(plot, margin.top + margin.bottom + step * names.length, margin);
    box.y = (index) => margin.top + step * index + (above ? 16 : 2) + row / 2;
    box.row = row;
    box.svg.append("g").selectAll("text").data(names).join("text").attr("class", "halo").attr("x", above ? 0 : box.left - 8)
      .attr("y", (_, i) => (above ? margin.top + step * i + 12 : box.y(i) + 4)).attr("text-anchor", above ? "start" : "end")
      .text((name) => name);
    return box;
  }

  // A group a mark, in the order of the table's rows.
  function markGroups(box, chart) {
    return box.svg.append("g").selectAll("g").data(chart.marks).join("g").attr("class", "mark").attr("role", "img");
  }

  // The sign of a mark: its series' shape, hollow if not measured; a cross if invalid.
  function sign(group, mark, series, size) {
    if (mark.invalid) {
      group.append("path").attr("d", "M-5,-5L5,5M-5,5L5,-5").attr("stroke", "var(--bad)").attr("stroke-width", 2.5)
        .attr("fill", "none");
      return;
    }
    group.append("path").attr("d", symbol(series, size)).attr("fill", measured(mark) ? color(series) : "var(--page)")
      .attr("stroke", color(series)).attr("stroke-width", 2);
  }

  function legend(plot, entries) {
    if (entries.length === 0) return;
    const items = plot.append("ul").attr("class", "legend").selectAll("li").data(entries).join("li");
    items.append("svg").attr("viewBox", "-8 -8 16 16").attr("aria-hidden", "true").each(function (entry) {
      entry.draw(d3.select(this));
    });
    items.append("span").text((entry) => entry.text);
  }

  // Those that the chart names have their colours, whether they occur or not.
  const seriesOf = (chart) => unique(chart.series.concat(chart.marks.map((mark) => mark.series)));

  function seriesLegend(chart, series) {
    const used = series.map((name, i) => ({
      text: name, draw: (svg) => sign(svg, {}, i, 64),
    })).filter((entry) => chart.marks.some((mark) => mark.series === entry.text));
    const entries = used.length < 2 ? [] : used;
    const other = unique(chart.marks.filter((mark) => mark.provenance).map((mark) => mark.provenance));
    if (other.length > 0) {
      entries.push({text: `hollow: not measured (${other.join(", ")})`, draw: (svg) => sign(svg, {provenance: "other"}, 7, 64)});
    }
    if (chart.marks.some((mark) => mark.invalid)) entries.push({text: "invalid", draw: (svg) => sign(svg, {invalid: "x"}, 0, 64)});
    return entries;
  }

  // The charts.

  // A line a group, in it a dot a series with its interval; the series below one another, so that none hides another.
  function drawDots(plot, chart) {
    const groups = unique(chart.marks.map((mark) => mark.group));
    const series = seriesOf(chart);
    legend(plot, seriesLegend(chart, series));
    const lane = 12;
    const box = layRows(plot, groups, lane * series.length);
    const values = [].concat(...chart.marks.map((mark) => [mark.x, mark.low, mark.high]));
    const x = scale(chart.x, extent(values, chart.x.log), [box.left + 6, box.right - 6]);
    bottomAxis(box, chart.x, x);
    markGroups(box, chart).each(function (mark) {
      const index = series.indexOf(mark.series);
      const y = box.y(groups.indexOf(mark.group)) + lane * (index - (series.length - 1) / 2);
      const group = d3.select(this);
      const stands = known(mark.x) && (!chart.x.log || mark.x > 0);
      if (stands && known(mark.low) && known(mark.high) && (!chart.x.log || mark.low > 0)) {
        group.append("path").attr("d", `M${x(mark.low)},${y}H${x(mark.high)}`).attr("stroke", color(index)).attr("stroke-width", 3)
          .attr("opacity", 0.55);
      }
      if (stands) {
        sign(group.append("g").attr("transform", `translate(${x(mark.x)},${y})`), mark, index, 64);
      } else {
        const edge = mark.far ? box.right - 6 : box.left + 6;
        const at = group.append("g").attr("transform", `translate(${edge},${y})`);
        sign(at, mark.word ? mark : Object.assign({provenance: "none"}, mark), index, 30); // Hollow, if there is no figure.
        group.append("text").attr("class", "soft halo").attr("x", edge + (mark.far ? -10 : 10)).attr("y", y + 4)
          .attr("text-anchor", mark.far ? "end" : "start").text(mark.invalid ? `invalid: ${mark.invalid}` : mark.word || "not known");
      }
    });
  }

  // A bar a mark, of parts one after the other; the total behind it.
  function drawStacks(plot, chart) {
    legend(plot, chart.parts.map((name, i) => ({
      text: name, draw: (svg) => svg.append("rect").attr("x", -7).attr("y", -7).attr("width", 14).attr("height", 14).attr("fill", color(i)),
    })).concat(seriesLegend(chart, [])));
    const box = layRows(plot, chart.marks.map((mark) => mark.group), 16);
    const total = (mark) => d3.sum(mark.values || []);
    const x = scale(chart.x, [0, (d3.max(chart.marks, total) || 1) * 1.02], [box.left, box.right - 60]);
    bottomAxis(box, chart.x, x);
    markGroups(box, chart).each(function (mark, row) {
      const group = d3.select(this);
      const y = box.y(row);
      let from = 0;
      (mark.values || []).forEach((value, part) => {
        const wide = x(from + value) - x(from);
        if (value > 0) {
          group.append("rect").attr("x", x(from)).attr("y", y - 7).attr("width", Math.max(0.75, wide - 0.75)).attr("height", 14)
            .attr("fill", color(part)).attr("fill-opacity", measured(mark) ? 1 : 0.25)
            .attr("stroke", measured(mark) ? "none" : color(part));
        }
        from += value;
      });
      if (mark.invalid) sign(group.append("g").attr("transform", `translate(${x(0) + 8},${y})`), mark, 0);
      group.append("text").attr("class", "halo").attr("x", x(from) + (mark.invalid ? 18 : 5)).attr("y", y + 4)
        .text(mark.invalid ? `invalid: ${mark.invalid}` : `${mark.mark || ""}${short(from)}${mark.doubt || ""}`);
    });
  }

  // A strip a mark: a tick a quantile, so that where many samples are it is dark; the long one is the median.
  function drawQuantiles(plot, chart) {
    const series = seriesOf(chart);
    legend(plot, seriesLegend(chart, series));
    const box = layRows(plot, chart.marks.map((mark) => mark.group), 16);
    const all = [].concat(...chart.marks.map((mark) => mark.values || []));
    const x = scale(chart.x, extent(all, chart.x.log), [box.left + 2, box.right - 6]);
    bottomAxis(box, chart.x, x);
    markGroups(box, chart).each(function (mark, row) {
      const group = d3.select(this);
      const index = series.indexOf(mark.series);
      const y = box.y(row);
      const values = (mark.values || []).filter((value) => !chart.x.log || value > 0);
      if (values.length === 0 || !known(mark.x)) {
        sign(group.append("g").attr("transform", `translate(${box.left + 6},${y})`), mark, index, 30);
        group.append("text").attr("class", "soft halo").attr("x", box.left + 16).attr("y", y + 4).text(mark.invalid || "no samples");
        return;
      }
      const tick = (value, half) => `M${x(value).toFixed(1)},${(y - half).toFixed(1)}v${2 * half}`;
      const inside = mark.invalid ? "var(--bad)" : color(index);
      group.append("path").attr("d", `M${x(values[0])},${y}H${x(values[values.length - 1])}`).attr("stroke", inside).attr("opacity", 0.5);
      group.append("path").attr("d", values.map((value) => tick(value, 5)).join("")).attr("stroke", inside).attr("opacity", 0.35);
      group.append("path").attr("d", tick(mark.x, 8)).attr("stroke", inside).attr("stroke-width", 2.5);
      if (mark.invalid) sign(group.append("g").attr("transform", `translate(${x(mark.x)},${y})`), mark, index);
    });
  }

  // Names beside points: points that nearly coincide share one, and a name that finds no free place stands in the table only.
  function nameMarks(box, places) {
    const taken = places.map((place) => ({left: place.x - 6, right: place.x + 6, top: place.y - 6, bottom: place.y + 6}));
    const meets = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    const shared = [];
    for (const place of places) {
      const near = shared.find((each) => Math.hypot(each.x - place.x, each.y - place.y) < 8);
      if (near) near.names.push(place.name);
      else shared.push({x: place.x, y: place.y, names: [place.name]});
    }
    for (const place of shared) {
      const text = unique(place.names).join(", ");
      const wide = text.length * kCharacter;
      const right = 9, left = -9 - wide, middle = -wide / 2;
      for (const [dx, dy] of [[right, 4], [left, 4], [middle, -10], [middle, 19], [right, -10], [right, 19], [left, -10], [left, 19]]) {
        const area = {left: place.x + dx, right: place.x + dx + wide, top: place.y + dy - 11, bottom: place.y + dy + 3};
        const outside = area.left < box.left || area.right > box.width || area.top < 0 || area.bottom > box.bottom;
        if (outside || taken.some((each) => meets(area, each))) continue;
        taken.push(area);
        box.svg.append("text").attr("class", "halo").attr("x", area.left).attr("y", place.y + dy).text(text);
        break;
      }
    }
  }

  function drawLines(box, chart, x, y) {
    const [left, right] = x.domain();
    const [low, high] = y.domain();
    for (const line of chart.lines) {
      let points = line.points;
      if (known(line.x)) points = [[line.x, low], [line.x, high]];
      if (known(line.y)) points = [[left, line.y], [right, line.y]];
      box.svg.append("path").attr("class", "reference").attr("d", d3.line().x((p) => x(p[0])).y((p) => y(p[1]))(points));
      const last = points[points.length - 1];
      box.svg.append("text").attr("class", "soft halo").attr("text-anchor", known(line.x) ? "start" : "end")
        .attr("x", known(line.x) ? x(line.x) + 4 : x(last[0]) - 2).attr("y", known(line.x) ? box.top + 12 : y(last[1]) - 5)
        .text(line.label);
    }
  }

  function drawScatter(plot, chart) {
    const series = seriesOf(chart);
    legend(plot, seriesLegend(chart, series));
    const width = Math.max(280, plot.node().clientWidth);
    const box = canvas(plot, Math.max(300, Math.min(440, width * 0.6)), {left: 56, right: 16, top: 28, bottom: 42});
    const along = (name, axis) => extent(chart.marks.map((mark) => mark[name])
      
      .concat(...chart.lines.map((line) => line.points.map((p) => p[name === "x" ? 0 : 1])), chart.lines.map((line) => line[name])),
    axis.log, true);
    const x = scale(chart.x, along("x", chart.x), [box.left, box.right]);
    const y = scale(chart.y, along("y", chart.y), [box.bottom, box.top]);
    bottomAxis(box, chart.x, x);
    leftAxis(box, chart.y, y);
    drawLines(box, chart, x, y);
    const places = [];
    markGroups(box, chart).each(function (mark) {
      const place = {
        x: known(mark.x) ? x(mark.x) : box.left,
        y: known(mark.y) ? y(mark.y) : box.bottom,
        name: mark.group,
        rank: series.indexOf(mark.series),
      };
      places.push(place);
      sign(d3.select(this).append("g").attr("transform", `translate(${place.x},${place.y})`), mark, place.rank, 70);
    });
    nameMarks(box, places.sort((a, b) => a.rank - b.rank)); // The first series, those that nobody beats, find a place first.
  }

  // A lane a group; a slice a mark, with its name where it fits.
  function drawTimeline(plot, chart) {
    const lanes = unique(chart.marks.map((mark) => mark.group));
    const series = seriesOf(chart);
    legend(plot, series.map((name, i) => ({
      text: name, draw: (svg) => svg.append("rect").attr("x", -7).attr("y", -7).attr("width", 14).attr("height", 14).attr("fill", color(i)),
    })));
    const box = layRows(plot, lanes, 26);
    const x = scale(chart.x, [d3.min(chart.marks, (mark) => mark.low), d3.max(chart.marks, (mark) => mark.high)], [box.left, box.right]);
    bottomAxis(box, chart.x, x);
    markGroups(box, chart).each(function (mark) {
      const group = d3.select(this);
      const index = series.indexOf(mark.series);
      const y = box.y(lanes.indexOf(mark.group));
      const wide = Math.max(1, x(mark.high) - x(mark.low));
      group.append("rect").attr("x", x(mark.low)).attr("y", y - 12).attr("width", Math.max(1, wide - 0.5)).attr("height", 24)
        .attr("fill", color(index)).attr("rx", wide > 6 ? 2 : 0);
      const name = mark.word || mark.series;
      if (name.length * kCharacter + 6 < wide) {
        group.append("text").attr("x", x(mark.low) + 3).attr("y", y + 4).style("fill", "var(--page)").text(name);
      }
    });
  }

  const kDraw = {dots: drawDots, stacks: drawStacks, quantiles: drawQuantiles, scatter: drawScatter, timeline: drawTimeline};

  // What is said of a mark: its row of the table.
  function rowTexts(figure) {
    const headers = Array.from(figure.querySelectorAll("thead th"), (cell) => cell.textContent);
    return Array.from(figure.querySelectorAll("tbody tr"), (row) => Array.from(row.cells)
      .map((cell, i) => (headers[i] ? `${headers[i]} ${cell.textContent}` : cell.textContent))
      .filter((_, i) => row.cells[i].textContent !== "").join("; "));
  }

  // One mark of a chart is in the order of tabs; arrows, Home and End go from it to the others.
  function listen(figure) {
    const texts = rowTexts(figure);
    const readout = figure.querySelector(".readout");
    const marks = d3.select(figure).selectAll(".mark");
    const nodes = marks.nodes();
    const say = (i) => { readout.textContent = texts[i]; };
    marks.attr("aria-label", (_, i) => texts[i]).attr("tabindex", (_, i) => (i === 0 ? 0 : -1));
    nodes.forEach((node, i) => {
      node.addEventListener("focus", () => say(i));
      node.addEventListener("mouseenter", () => say(i));
      node.addEventListener("click", () => say(i));
      node.addEventListener("keydown", (event) => {
        const to = {ArrowRight: i + 1, ArrowDown: i + 1, ArrowLeft: i - 1, ArrowUp: i - 1, Home: 0, End: nodes.length - 1}[event.key];
        if (event.key === "Escape") readout.textContent = "";
        if (to === undefined || !nodes[to]) return;
        event.preventDefault();
        node.setAttribute("tabindex", -1);
        nodes[to].setAttribute("tabindex", 0);
        nodes[to].focus();
      });
    });
  }

  function drawAll(charts) {
    charts.forEach((chart, i) => {
      const figure = document.getElementById(`chart-${i + 1}`);
      const plot = d3.select(figure).select(".plot");
      plot.selectAll("*").remove();
      if (chart.marks.length === 0) return;
      kDraw[chart.kind](plot, chart);
      plot.select("svg[role=group]").attr("aria-label", chart.title).attr("aria-describedby", `chart-${i + 1}-summary`);
      listen(figure);
    });
  }

  // Print shows the tables too.
  function openTablesForPrint() {
    let opened = [];
    window.addEventListener("beforeprint", () => {
      opened = Array.from(document.querySelectorAll("details:not([open])"));
      opened.forEach((each) => { each.open = true; });
    });
    window.addEventListener("afterprint", () => opened.forEach((each) => { each.open = false; }));
  }

  function redrawOnResize(charts) {
    let width = document.body.clientWidth;
    let timer = 0;
    window.addEventListener("resize", () => {
      window.clearTimeout(timer);
      timer = window.setTimeout(() => {
        if (document.body.clientWidth === width) return;
        width = document.body.clientWidth;
        drawAll(charts);
      }, 100);
    });
  }

  const charts = JSON.parse(document.getElementById("charts").textContent);
  drawAll(charts);
  openTablesForPrint();
  redrawOnResize(charts);
  document.documentElement.dataset.drawnMs = performance.now().toFixed(0);
})();
