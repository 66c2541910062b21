"""The console's colours, boxes and letters."""

import pygame

# Okabe and Ito's colours, but a red that is darker than the amber: the colour-blind tell them apart by that, by shape
# and by words.
BACK, PANEL, EDGE, TEXT, DIM = (18, 20, 24), (32, 36, 43), (70, 76, 86), (236, 238, 240), (150, 156, 166)
INK, WHITE = (0, 0, 0), (255, 255, 255)  # letters on the colours below: at least 4.5 to 1, as WCAG AA has it
AMBER, RED, BLUE, GREEN, SKY = (230, 159, 0), (192, 40, 40), (0, 114, 178), (0, 158, 115), (86, 180, 233)


def panel(surface: pygame.Surface, box: pygame.Rect, title: str) -> None:
    """A titled box."""
    pygame.draw.rect(surface, PANEL, box, border_radius=6)
    write(surface, title, (box.x + 10, box.y + 8), 22, DIM)


def write(
    surface: pygame.Surface,
    words: str,
    at: tuple[int, int],
    size: int,
    colour: tuple[int, int, int],
    *,
    centre: bool = False,
) -> int:
    """Write a line and return its width in pixels."""
    if not words:
        return 0
    if size not in _FONTS:
        _FONTS[size] = pygame.font.Font(None, size)
    image = _FONTS[size].render(words, True, colour)
    surface.blit(image, image.get_rect(center=at) if centre else image.get_rect(topleft=at))
    return image.get_width()


def write_lines(
    surface: pygame.Surface, words: str, at: tuple[int, int], size: int, colour: tuple[int, int, int], width: int
) -> int:
    """Write words in as many lines as they need. Returns where the next line would be, in pixels from the top."""
    font = _FONTS.setdefault(size, pygame.font.Font(None, size))
    line, (x, y) = "", at
    for word in [*words.split(), ""]:
        longer = f"{line} {word}".strip()
        if word and font.size(longer)[0] <= width:
            line = longer
            continue
        write(surface, line, (x, y), size, colour)
        line, y = word, y + font.get_linesize()
    return y


_FONTS: dict[int, pygame.font.Font] = {}
