"""Analysis, viewing and checking of Equipoise: what runs beside the firmware, never inside it."""
