"""The console's colours."""

# Okabe and Ito's colours, but a red that is darker than the amber: the colour-blind tell them apart by that, by shape
# and by words.
BACK, PANEL, EDGE, TEXT, DIM = (18, 20, 24), (32, 36, 43), (70, 76, 86), (236, 238, 240), (150, 156, 166)
INK, WHITE = (0, 0, 0), (255, 255, 255)  # letters on the colours below: at least 4.5 to 1, as WCAG AA has it
AMBER, RED, BLUE, GREEN, SKY = (230, 159, 0), (192, 40, 40), (0, 114, 178), (0, 158, 115), (86, 180, 233)
