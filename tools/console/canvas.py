"""A part of a surface to draw on in the console's own units, whatever size it has: lines and letters stay sharp."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Self

import pygame

SMALLEST = 14  # pixels; smaller letters cannot be read
Colour = tuple[int, int, int]
Point = tuple[float, float]
Box = pygame.Rect | tuple[float, float, float, float]


class Canvas:
    """Everything is given in units of the console's own size, of which `scale` pixels make one, from `origin` on."""

    def __init__(self, surface: pygame.Surface, scale: float = 1.0, origin: tuple[int, int] = (0, 0)) -> None:
        self._surface, self._scale, self._origin = surface, scale, origin

    @classmethod
    def fitted(cls, surface: pygame.Surface, size: tuple[int, int]) -> Self:
        """As much of a surface as a console of this size fills: whole, in proportion, in the middle."""
        box = fitted(size, surface.get_size())
        return cls(surface, box.width / size[0], box.topleft)

    def fill(self, colour: Colour) -> None:
        """Fill the whole surface, also what is beside the console."""
        self._surface.fill(colour)

    def rect(self, colour: Colour, box: Box, width: int = 0, radius: int = 0) -> None:
        """A box, filled or with an edge of this width."""
        pygame.draw.rect(self._surface, colour, self._box(box), self._width(width), self._width(radius))

    def polygon(self, colour: Colour, points: Sequence[Point]) -> None:
        """A filled polygon."""
        pygame.draw.polygon(self._surface, colour, [self._at(point) for point in points])

    def lines(self, colour: Colour, points: Sequence[Point], width: int = 1) -> None:
        """A line from point to point."""
        pygame.draw.lines(self._surface, colour, False, [self._at(point) for point in points], self._width(width))

    def circle(self, colour: Colour, at: Point, radius: float) -> None:
        """A filled circle."""
        pygame.draw.circle(self._surface, colour, self._at(at), max(1.0, radius * self._scale))

    def picture(self, image: pygame.Surface, box: Box) -> None:
        """A picture as large as fits into the middle of a box, pixel by pixel."""
        place = self._box(box)
        inside = fitted(image.get_size(), place.size).move(place.topleft)
        self._surface.blit(pygame.transform.scale(image, inside.size), inside)

    def write(self, words: str, at: Point, size: int, colour: Colour, *, centre: bool = False) -> float:
        """Write a line and return its width."""
        if not words:
            return 0.0
        image = self._font(size).render(words, True, colour)
        place = self._at(at)
        self._surface.blit(image, image.get_rect(center=place) if centre else image.get_rect(topleft=place))
        return image.get_width() / self._scale

    def write_lines(self, words: str, at: Point, size: int, colour: Colour, width: float) -> float:
        """Write words in as many lines as they need. Returns where the next line would be, from the top."""
        font = self._font(size)
        line, (x, y) = "", at
        for word in [*words.split(), ""]:
            longer = f"{line} {word}".strip()
            if word and font.size(longer)[0] <= width * self._scale:
                line = longer
                continue
            self.write(line, (x, y), size, colour)
            line, y = word, y + font.get_linesize() / self._scale
        return y

    def _font(self, size: int) -> pygame.font.Font:
        return _font(max(SMALLEST, round(size * self._scale)))

    def _at(self, point: Point) -> tuple[int, int]:
        x, y = point
        return self._origin[0] + round(x * self._scale), self._origin[1] + round(y * self._scale)

    def _box(self, box: Box) -> pygame.Rect:
        """Both edges to whole pixels, so that boxes that touch still do."""
        x, y, width, height = box
        (left, top), (right, bottom) = self._at((x, y)), self._at((x + width, y + height))
        return pygame.Rect(left, top, right - left, bottom - top)

    def _width(self, width: int) -> int:
        return 0 if width == 0 else max(1, round(width * self._scale))


def fitted(size: tuple[int, int], window: tuple[int, int]) -> pygame.Rect:
    """Where in a window a picture of this size goes: as large as it fits, in the middle."""
    scale = min(window[0] / size[0], window[1] / size[1])
    box = pygame.Rect(0, 0, max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
    box.center = (window[0] // 2, window[1] // 2)
    return box


@lru_cache(maxsize=64)
def _font(pixels: int) -> pygame.font.Font:
    return pygame.font.Font(None, pixels)
