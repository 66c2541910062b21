"""What LIRA-SPF is compared with: one page each, its rule in its paper's symbols, one interface."""
