"""The report: one HTML file about problems and their solutions, or about a study.

gather      the data of all cases, from problem files: read this first; the requirements A to D as in the paper's tables
cases       one case: question, sizes by name, answer, certificate, sensitivities, poses
families    the frames along tolerance and motion
frames      what scene, curve and numbers show at one place; bodies and features as triangles and edges
page        these data for the template `page.html`, and the folder of a study for `study.html`

Templates, style and scripts are in `show/templates`. `frame.html` is what both pages stand in, `pieces.html` their
small pieces; `curve.js`, `scene.js`, `page.js`, `study.js` draw, and `common.js` serves all.
"""
