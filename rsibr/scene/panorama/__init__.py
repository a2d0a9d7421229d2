"""Pictures of an environment as files hold them: OpenEXR and Radiance, with the layout and colour that they state.

What a header says about the picture is obeyed, or refused in one line; `rsibr.scene.latlong` puts the steps together.
OpenEXR files are decoded in another process (`exr`, `exr_server`): no file can end this one.
"""
