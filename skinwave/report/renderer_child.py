"""Run by `renderer` in a process of its own: draw in a small window, and print its class."""

import pyvista as pv

if __name__ == "__main__":
    plotter = pv.Plotter(off_screen=True, window_size=(32, 32))
    plotter.add_mesh(pv.Sphere())
    plotter.screenshot(None, return_img=True)
    print(type(plotter.render_window).__name__)
    plotter.close()
