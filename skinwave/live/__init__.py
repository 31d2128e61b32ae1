"""The live page: bodies are reduced here, and their motion is computed in the browser."""
