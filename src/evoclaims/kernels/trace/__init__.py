"""From a jaxpr to scalar expressions, simplified and shortened."""
