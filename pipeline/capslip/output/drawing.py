"""Surfaces, colour bars, legends and words in three dimensions, each under its name.

Drawn by VTK itself: PyVista, which the window is made with, loads longer than a picture takes.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

Place = tuple[float, float]  # shares of the width and the height of the window
SHADES = 256  # of a colour bar
SHINE = 100.0  # exponent of the highlights
BAR_HEIGHT, BAR_TITLE_pt, BAR_LABEL_pt = 0.08, 18, 16
ENTRY_HEIGHT, ENTRY_WIDTH, BORDER = 0.035, 0.2, 0.05  # of a legend
LINE_SPACING = 1.25  # of words: VTK's own lets lines touch
WORD_SCALE = 5.0  # of the window
AXES = {"X": "#FF6347", "Y": "#2E8B57", "Z": "#0000FF"}
AXES_PLACE = (0.0, 0.1, 0.12, 0.28)  # left, below, right and above, shares of the window


class Drawing:
    """What a renderer of VTK shows.

    Parameters
    ----------
    renderer : vtkRenderer
        That of a window.
    """

    def __init__(self, renderer: Any) -> None:
        self.renderer = renderer
        self.window = renderer.GetRenderWindow()
        self.parts: dict[str, Any] = {}
        self.lifts: dict[str, float] = {}  # by how much parts are drawn above their points
        renderer.SetBackground(1.0, 1.0, 1.0)
        self._marker = _axes(self.window.GetInteractor())

    def surface(
        self,
        name: str,
        points: np.ndarray,
        cells: np.ndarray,
        colour: str = "#FFFFFF",
        values: np.ndarray | None = None,
        colours: "Sequence[str]" = (),
        limits: tuple[float, float] = (0.0, 1.0),
        specular: float = 0.0,
        lit: bool = True,
        opacity: float = 1.0,
        closer: float = 0.0,
    ) -> None:
        """Show cells of three or four corners each, in one colour or by the values of points.

        Those with values look smooth. `closer` is how far towards the eye a part is drawn, so that
        parts that coincide do not speckle. Nothing is shown where there are no cells.
        """
        from vtkmodules.vtkCommonDataModel import vtkCellArray
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        self.remove(name)
        if not len(cells):
            return
        mesh, polygons = _mesh(points), vtkCellArray()
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        polygons.SetData(cells.shape[1], _array(cells.astype(np.int64).ravel()))
        mesh.SetPolys(polygons)
        look = actor.GetProperty()
        look.SetColor(*_rgb(colour))
        look.SetInterpolationToFlat()
        if values is not None:
            mesh.GetPointData().SetScalars(_array(values))
            mesh = _with_normals(mesh)
            mapper.SetLookupTable(_table(colours, limits))
            mapper.SetScalarRange(*limits)
            mapper.InterpolateScalarsBeforeMappingOn()
            look.SetInterpolationToPhong()
        look.SetSpecular(specular)
        look.SetSpecularPower(SHINE)
        look.SetLighting(lit)
        look.SetOpacity(opacity)
        mapper.SetInputData(mesh)
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, closer)
        actor.SetMapper(mapper)
        self._show(name, actor)

    def line(self, name: str, points: np.ndarray, colour: str, width: float = 1.0) -> None:
        """Join points to a line."""
        from vtkmodules.vtkCommonDataModel import vtkCellArray
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        mesh, lines, mapper, actor = _mesh(points), vtkCellArray(), vtkPolyDataMapper(), vtkActor()
        lines.SetData(len(points), _array(np.arange(len(points))))
        mesh.SetLines(lines)
        mapper.SetInputData(mesh)
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*_rgb(colour))
        actor.GetProperty().SetLineWidth(width)
        actor.GetProperty().LightingOff()
        self._show(name, actor)

    def bar(self, name: str, of: str, title: str, place: Place, width: float) -> None:
        """Show the colours of the values of a surface."""
        from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor

        bar = vtkScalarBarActor()
        table = self.parts[of].GetMapper().GetLookupTable()
        bar.SetLookupTable(table)
        bar.SetMaximumNumberOfColors(table.GetNumberOfTableValues())
        bar.SetOrientationToHorizontal()
        bar.SetPosition(*place)
        bar.SetWidth(width)
        bar.SetHeight(BAR_HEIGHT)
        bar.SetNumberOfLabels(3)
        bar.SetLabelFormat("%.6g")  # of round ends: 1000, where three digits are 1e+03
        bar.SetTitle(f"{title}\n")
        bar.UnconstrainedFontSizeOn()
        bar.GetTitleTextProperty().SetJustificationToCentered()
        _plain(bar.GetTitleTextProperty(), BAR_TITLE_pt)
        _plain(bar.GetLabelTextProperty(), BAR_LABEL_pt)
        self._show(name, bar)

    def legend(self, name: str, entries: "Sequence[tuple[str, str]]") -> None:
        """List words, each with its colour, above the left end."""
        from vtkmodules.vtkRenderingAnnotation import vtkLegendBoxActor

        square = _mesh(np.array([(-0.5, 0.1, 0), (0.5, 0.1, 0), (0.5, 1.1, 0), (-0.5, 1.1, 0)]))
        square.Allocate(1)
        square.InsertNextCell(9, 4, range(4))
        legend, height = vtkLegendBoxActor(), ENTRY_HEIGHT * len(entries)
        legend.SetNumberOfEntries(len(entries))
        for i, (words, colour) in enumerate(entries):
            legend.SetEntry(i, square, words, _rgb(colour))
        legend.SetPosition(BORDER, 1.0 - BORDER - height)
        legend.SetPosition2(ENTRY_WIDTH, height)
        legend.BorderOff()
        self._show(name, legend)

    def words(self, name: str, text: str) -> None:
        """Write lines in the lower left corner."""
        from vtkmodules.vtkRenderingAnnotation import vtkCornerAnnotation

        corner = vtkCornerAnnotation()
        corner.SetText(0, text)
        corner.SetLinearFontScaleFactor(WORD_SCALE)
        corner.GetTextProperty().SetColor(0.0, 0.0, 0.0)
        corner.GetTextProperty().SetLineSpacing(LINE_SPACING)
        self._show(name, corner)

    def labels(self, name: str, points: np.ndarray, words: "Sequence[str]", size_pt: int) -> None:
        """Write a word at each point, where it hides no other."""
        from vtkmodules.vtkCommonCore import vtkStringArray
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkTextProperty
        from vtkmodules.vtkRenderingLabel import (
            vtkLabelPlacementMapper,
            vtkPointSetToLabelHierarchy,
        )

        texts, mesh, how = vtkStringArray(), _mesh(points), vtkTextProperty()
        texts.SetName("words")
        for word in words:
            texts.InsertNextValue(word)
        mesh.GetPointData().AddArray(texts)
        _plain(how, size_pt)
        how.BoldOn()
        places = vtkPointSetToLabelHierarchy()
        places.SetInputData(mesh)
        places.SetLabelArrayName("words")
        places.SetTextProperty(how)
        mapper, actor = vtkLabelPlacementMapper(), vtkActor2D()
        mapper.SetInputConnection(places.GetOutputPort())
        mapper.SetShapeToRoundedRect()
        mapper.SetStyleToFilled()
        mapper.SetBackgroundColor(0.5, 0.5, 0.5)
        mapper.SetBackgroundOpacity(0.6)
        mapper.SetMargin(3)
        actor.SetMapper(mapper)
        self._show(name, actor)

    def remove(self, *names: str) -> None:
        """Show some parts no longer; those that are not there are passed over."""
        for name in names:
            part = self.parts.pop(name, None)
            self.lifts.pop(name, None)
            if part is not None:
                self.renderer.RemoveViewProp(part)

    def stretch(self, factor: float) -> None:
        """Enlarge the heights of all surfaces and lines."""
        for name, part in self.parts.items():
            if hasattr(part, "SetScale"):
                part.SetScale(1.0, 1.0, factor)
                part.SetPosition(0.0, 0.0, factor * self.lifts.get(name, 0.0))

    def look(self, towards: tuple[float, ...], up: tuple[float, ...], zoom: float = 1.0) -> None:
        """Look at the middle of everything from a direction."""
        x0, x1, y0, y1, z0, z1 = self.renderer.ComputeVisiblePropBounds()
        middle = np.array([x0 + x1, y0 + y1, z0 + z1]) / 2.0
        camera = self.renderer.GetActiveCamera()
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + towards))
        camera.SetViewUp(*up)
        self.renderer.ResetCamera()
        camera.Zoom(zoom)

    def pixels(self) -> np.ndarray:
        """Return what is seen, shape (rows, columns, 3), one byte a colour."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

        self.window.Render()
        read = vtkWindowToImageFilter()
        read.SetInput(self.window)
        read.ReadFrontBufferOff()
        read.ShouldRerenderOff()
        read.Update()
        width, height = self.window.GetSize()
        flat = vtk_to_numpy(read.GetOutput().GetPointData().GetScalars())
        return np.asarray(flat.reshape(height, width, 3)[::-1])

    def _show(self, name: str, part: Any) -> None:
        self.remove(name)
        self.parts[name] = part
        self.renderer.AddViewProp(part)


def off_screen(size: tuple[int, int]) -> Drawing:
    """Return an empty drawing of so many pixels that no display is needed for."""
    import vtkmodules.vtkRenderingFreeType
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkRenderingCore import (
        vtkLightKit,
        vtkRenderer,
        vtkRenderWindow,
        vtkRenderWindowInteractor,
    )

    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.OffScreenRenderingOn()
    window.SetSize(*size)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    vtkRenderWindowInteractor().SetRenderWindow(window)
    renderer.UseFXAAOn()  # as smooth as four samples of a pixel, in half of their time
    vtkLightKit().AddLightsToRenderer(renderer)
    return Drawing(renderer)


def _axes(interactor: Any) -> Any:
    """Show which way x, y and z point, in a corner."""
    from vtkmodules.vtkInteractionWidgets import vtkOrientationMarkerWidget
    from vtkmodules.vtkRenderingAnnotation import vtkAxesActor

    axes, marker = vtkAxesActor(), vtkOrientationMarkerWidget()
    for name, colour in AXES.items():
        caption = getattr(axes, f"Get{name}AxisCaptionActor2D")()
        caption.GetCaptionTextProperty().SetColor(0.0, 0.0, 0.0)
        caption.GetCaptionTextProperty().ShadowOff()
        for part in ("Shaft", "Tip"):
            look = getattr(axes, f"Get{name}Axis{part}Property")()
            look.SetColor(*_rgb(colour))
            look.SetAmbient(0.5)
            look.SetLineWidth(2.0)
    marker.SetOrientationMarker(axes)
    marker.SetInteractor(interactor)
    marker.SetViewport(*AXES_PLACE)
    marker.EnabledOn()
    marker.InteractiveOff()
    return marker


def _rgb(colour: str) -> list[float]:
    return [byte / 255.0 for byte in bytes.fromhex(colour[1:])]


def _array(values: np.ndarray) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk

    return numpy_to_vtk(np.ascontiguousarray(values), deep=True)


def _mesh(points: np.ndarray) -> Any:
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    places, mesh = vtkPoints(), vtkPolyData()
    places.SetData(_array(np.asarray(points, dtype=float)))
    mesh.SetPoints(places)
    return mesh


def _with_normals(mesh: Any) -> Any:
    """Return a mesh with normals of its points; its cells are in order as they are."""
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    normals = vtkPolyDataNormals()
    normals.SetInputData(mesh)
    normals.ConsistencyOff()
    normals.SplittingOff()
    normals.NonManifoldTraversalOff()
    normals.Update()
    return normals.GetOutput()


def _table(colours: "Sequence[str]", limits: tuple[float, float]) -> Any:
    from vtkmodules.vtkCommonCore import vtkLookupTable

    table = vtkLookupTable()
    table.SetNumberOfTableValues(len(colours))
    for i, colour in enumerate(colours):
        table.SetTableValue(i, *_rgb(colour))
    table.SetTableRange(*limits)
    return table


def _plain(text: Any, size_pt: int) -> None:
    text.SetColor(0.0, 0.0, 0.0)
    text.SetFontSize(size_pt)
    text.BoldOff()
    text.ItalicOff()
    text.ShadowOff()
