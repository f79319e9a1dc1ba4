"""Pictures from code: matplotlib axes of a shell, a sheet, the checks; and a poster of a design."""

from phexfab.plots.checks import plot_checks
from phexfab.plots.posters import poster
from phexfab.plots.sheets import plot_sheet
from phexfab.plots.shells import plot_gauss, plot_shell

__all__ = ["plot_checks", "plot_gauss", "plot_sheet", "plot_shell", "poster"]
