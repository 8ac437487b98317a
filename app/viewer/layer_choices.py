"""Layers that each page is shown: the choice of one browser changes what no other one sees.

A layer is drawn, for all, while a page that is open shows it. Which of them a browser sees are a few messages of its
own, sent when its choice changes (see `Broadcaster`): a frame costs the same whatever others choose.
"""

from collections import OrderedDict
from collections.abc import Iterable, Mapping

import viser

from app.viewer.scene.layers import LAYERS
from app.viewer.scene.scene import Scene
from app.viewer.transport.scene_updates import SceneUpdates

MAX_PAGES = 200  # whose choices are kept, those that were used last: a page may lose its scene and open it again


class LayerChoices:
    """Choice of layers of each page, and of pages to come. Belongs to viser's event loop."""

    def __init__(self, scene: Scene, boxes: Mapping[str, viser.GuiCheckboxHandle]) -> None:
        """Begin with the layers that are on at the start.

        Args:
            scene: whose layers are switched.
            boxes: switches of the panel, by the names of their layers; each page is shown its own choice in them.
        """
        self._scene, self._boxes = scene, boxes
        self.of_new_pages = {name: layer.is_on for name, layer in LAYERS.items()}
        """Whether each layer is shown to a page that has not chosen."""
        self._pages = OrderedDict[str, tuple[dict[str, bool], SceneUpdates]]()

    @property
    def pages(self) -> list[str]:
        """Ids of the pages whose choices are kept, the one that was used last at the end."""
        return list(self._pages)

    def of(self, page: str) -> dict[str, bool]:
        """Whether each layer is shown to a page, by the page's id."""
        return dict(self._pages[page][0]) if page in self._pages else dict(self.of_new_pages)

    def switch(self, page: str, layers: Mapping[str, bool]) -> None:
        """Show some layers to a page, or hide them."""
        self._page(page)[0].update(layers)
        self._tell(page)

    def switch_all(self, layers: Mapping[str, bool]) -> None:
        """Show some layers to all pages, those to come too, or hide them."""
        self.of_new_pages.update(layers)
        for page in self.pages:
            self.switch(page, layers)

    def take_over(self, former: "LayerChoices") -> None:
        """Show each page what another scene showed it."""
        self.of_new_pages = dict(former.of_new_pages)
        for page in former.pages:
            self.switch(page, former.of(page))

    def updates(self, page: str) -> SceneUpdates:
        """Messages that bring a page's scene to its choice."""
        return self._page(page)[1]

    def drawn(self, pages: Iterable[str]) -> frozenset[str]:
        """Names of the layers that at least one of some pages is shown."""
        return frozenset(name for page in pages for name, is_shown in self.of(page).items() if is_shown)

    def _page(self, page: str) -> tuple[dict[str, bool], SceneUpdates]:
        if page not in self._pages:
            self._pages[page] = dict(self.of_new_pages), SceneUpdates()
            self._tell(page)
            if len(self._pages) > MAX_PAGES:
                self._pages.popitem(last=False)
        self._pages.move_to_end(page)
        return self._pages[page]

    def _tell(self, page: str) -> None:
        layers, updates = self._pages[page]
        for name, is_shown in layers.items():
            self._scene.switch(updates, name, is_shown)
            updates.control(self._boxes[name], value=is_shown)
