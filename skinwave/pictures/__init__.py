"""Pictures: figures, maps, views in three dimensions, films."""
