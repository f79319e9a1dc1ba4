"""The methods that chapter 5 surveys, each with its limits raised as errors."""
