"""The report: one HTML file about problems and their solutions, or about a study.

gather      the data of all cases, from problem files: read this first
cases       one case: question, answer, certificate, sensitivities, poses
left_out    what was not modelled, in sentences
matrix      the requirements A to D as in the paper's Tables 1 and 2
families    the frames along tolerance and motion
frames      what scene, curve and numbers show at one place
scenes      bodies and features as triangles and edges
page        these data as one HTML text
study_page  the same for the folder of a study
markup      small pieces of HTML, and the frame that both pages stand in
assets      templates, style and scripts: `curve.js`, `scene.js`, `page.js`, `study.js`, and `common.js` of all
"""
