/** A scan on its design: the verdict, the figures, the part. */

import * as centres from './centres.js';
import { $, element, figure, fill } from './dom.js';
import * as part from './part.js';
import { MEANING, MOOD, mm, percent, short, signed } from './words.js';

export async function show(job, results, sizes, signal) {
  judge(results.verdict);
  $('figures').replaceChildren(...figures(results));
  bySegment(results);
  $('viewer').hidden = !sizes.has('design.glb');
  const shown = sizes.has('design.glb') ? part.openRegistration(job.id, results, sizes, signal) : null;
  const opened = centres.open(job, results, shown && part.panel, sizes, signal);
  await Promise.all([shown, opened]);
}

function judge({ status, confidence, findings }) {
  $('verdict').hidden = false;
  $('verdict').className = MOOD[status] ?? 'bad';
  $('status').textContent = status.replaceAll('_', ' ');
  $('confidence').textContent = confidence ? `confidence ${confidence.toFixed(2)}` : '';
  $('meaning').textContent = MEANING[status];
  $('findings').replaceChildren(...findings.map((each) => element('li', `${each.code.replaceAll('_', ' ')}: ${each.detail}`)));
}

function figures({ deviation, metrics, landmarks }) {
  if (!deviation) return [figure(['landmarks', `${landmarks.design.length} on the design, ${landmarks.scan.length} on the scan`])];
  const found = [
    ['RMS deviation', mm(deviation.rms_mm)],
    ['mean ± SD', `${signed(deviation.mean_mm).slice(0, -3)} ± ${mm(deviation.sd_mm)}`],
    ['1 % to 99 %', `${signed(deviation.p01_mm).slice(0, -3)} to ${signed(deviation.p99_mm)}`],
  ];
  if (deviation.within !== null) found.push([`within ±${short(deviation.tolerance_mm)} mm`, percent(deviation.within)]);
  found.push(
    ['overlap · coverage', `${percent(metrics.scan_overlap)} · ${percent(metrics.design_coverage)}`],
    ['landmarks matched', String(landmarks.matches.length)],
    ['K ratio', metrics.k_ratio === null ? '-' : metrics.k_ratio.toPrecision(3)],
  );
  return found.map(figure);
}

function bySegment({ deviation, segments }) {
  const rows = deviation?.by_segment ?? [];
  $('by-segment').hidden = !rows.length;
  if (!rows.length) return;
  const centreOf = new Map(segments.design.centres.map((each) => [each.segment, each]));
  fill(
    $('by-segment-table'),
    ['Segment', 'Vertices', 'Mean, mm', 'SD, mm', 'RMS, mm', 'Least, mm', 'Most, mm'],
    rows.map((each) => [
      element('button', [centres.swatch(each.segment), ` ${each.segment}`], {
        type: 'button',
        title: `show segment ${each.segment} on the part`,
        onclick: () => part.panel.point('design', centreOf.get(each.segment).position_mm, true),
      }),
      String(each.n),
      ...[each.mean_mm, each.sd_mm, each.rms_mm, each.min_mm, each.max_mm].map((value) => value.toFixed(3)),
    ]),
    [1, 2, 3, 4, 5, 6],
  );
}
