"""Page and engine: plain JavaScript, GLSL and CSS, put into one HTML file by Python."""
